#include "ve_state.hpp"

#include <fmt/format.h>

#include "errors.hpp"
#include "hash.hpp"
#include "packet.hpp"

namespace femxdem {
namespace {

constexpr std::string_view kMark = "femxdem-ve-state";
constexpr std::uint32_t kVersion = 2;  // 1 had another checksum

std::uint64_t checksum(std::string_view content) {
  Checksum sum;
  sum.add(content);
  return sum.value();
}

}  // namespace

std::string name_of(EngineKind engine) { return engine == EngineKind::yade ? "yade" : "compact"; }

std::string encode(const VeState& state) {
  PacketWriter packet;
  packet.put(kVersion);
  packet.put(static_cast<std::int32_t>(state.engine));
  packet.put(state.reference_time_scale);
  packet.put(state.origin);
  packet.put(std::string_view(state.bytes));
  const std::string content = packet.take();
  PacketWriter checked;
  checked.put(checksum(content));
  return std::string(kMark) + checked.take() + content;
}

std::optional<VeState> decode(std::string_view bytes) {
  if (!bytes.starts_with(kMark)) return std::nullopt;
  const auto damaged = [] {
    return UserError("saved volume element: its bytes are damaged or cut off; go back to an older checkpoint");
  };
  try {
    PacketReader checked(bytes.substr(kMark.size()));
    const auto expected = checked.get<std::uint64_t>();
    const std::string_view content = bytes.substr(kMark.size() + sizeof expected);
    PacketReader packet(content);
    const auto version = packet.get<std::uint32_t>();
    if (checksum(content) != expected && version != 1) throw damaged();
    if (version != kVersion)
      throw UserError(
          fmt::format("saved volume element: version {} of the format, this program reads {}; use the "
                      "program that wrote it",
                      version, kVersion));
    VeState state;
    state.engine = static_cast<EngineKind>(packet.get<std::int32_t>());
    state.reference_time_scale = packet.get<double>();
    state.origin = packet.get<std::uint64_t>();
    state.bytes = packet.get_text();
    return state;
  } catch (const std::out_of_range&) {
    throw damaged();
  }
}

void require_origin(std::uint64_t saved, std::uint64_t of_case) {
  if (saved == of_case) return;
  throw UserError(
      "checkpoint: a volume element was made from another packing than the case's; restart with the packings that it "
      "was run with (ve.cache)");
}

}  // namespace femxdem
