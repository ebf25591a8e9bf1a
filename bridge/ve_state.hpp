#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace femxdem {

/// Which engine a state belongs to.
enum class EngineKind : std::int32_t { yade, compact };

std::string name_of(EngineKind engine);

/// A volume element's committed state as it travels, to a checkpoint or to another rank: with it goes whatever decides
/// its next answer.
struct VeState {
  EngineKind engine = EngineKind::yade;
  double reference_time_scale = 0;  ///< see StrainedPoint [s]
  std::uint64_t origin = 0;         ///< of the scene that it was made as: the hash of that state
  std::string bytes;                ///< the engine's own
};

/// Bytes with a mark, a version and a checksum.
std::string encode(const VeState& state);
/// Nothing where the bytes have not the mark: an engine's own state, of a volume element as it was made. Throws
/// UserError for bytes that are damaged or of another version.
std::optional<VeState> decode(std::string_view bytes);
/// Throws UserError for a saved state of another origin than the case's volume element.
void require_origin(std::uint64_t saved, std::uint64_t of_case);

}  // namespace femxdem
