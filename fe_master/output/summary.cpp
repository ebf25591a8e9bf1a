#include "summary.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <ctime>
#include <string_view>
#include <utility>
#include <vector>

#include "output_folder.hpp"

namespace femxdem {
namespace {

std::string number(double value) { return std::isfinite(value) ? fmt::format("{:.15g}", value) : "null"; }

using Members = std::vector<std::pair<std::string, std::string>>;

std::string object(const Members& members, std::string_view indent) {
  std::string json = "{";
  std::string_view separator = "\n";
  for (const auto& [key, value] : members) {
    json += fmt::format("{}{}  {}: {}", separator, indent, quoted_text(key), value);
    separator = ",\n";
  }
  return json + fmt::format("\n{}}}", indent);
}

}  // namespace

std::string quoted_text(std::string_view text) {
  std::string json = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      json += {'\\', c};
    } else if (static_cast<unsigned char>(c) < 0x20) {
      json += fmt::format("\\u{:04x}", static_cast<int>(c));
    } else {
      json += c;
    }
  }
  return json + "\"";
}

std::string to_json(const Summary& summary, const std::string& date, const std::string& host) {
  const double capacity = summary.ranks * summary.threads * summary.evaluate_seconds;
  Members versions;
  for (const auto& [name, version] : summary.versions) versions.emplace_back(name, quoted_text(version));
  const Members members = {
      {"status", quoted_text(summary.status)},
      {"message", quoted_text(summary.message)},
      {"exit_status", number(summary.exit_status)},
      {"steps", number(summary.steps)},
      {"evaluations", number(static_cast<double>(summary.evaluations))},
      {"dem_steps", number(summary.dem_steps)},
      {"ranks", number(summary.ranks)},
      {"threads", number(summary.threads)},
      {"engine", quoted_text(summary.engine)},
      {"engine_check", quoted_text(summary.engine_check)},
      {"wall_seconds", number(summary.wall_seconds)},
      {"evaluate_seconds", number(summary.evaluate_seconds)},
      {"trial_seconds", number(summary.trial_seconds)},
      {"engine_seconds", number(summary.engine_seconds)},
      {"parallel_efficiency", number(summary.trial_seconds / capacity)},
      {"engine_share", number(summary.engine_seconds / capacity)},
      {"overhead_ratio", number(1 - summary.engine_seconds / capacity)},
      {"balance", number(summary.balance > 0 ? summary.balance : std::nan(""))},
      {"imbalance_before", number(summary.moved > 0 ? summary.imbalance_before : std::nan(""))},
      {"imbalance_after", number(summary.moved > 0 ? summary.imbalance_after : std::nan(""))},
      {"moved", number(static_cast<double>(summary.moved))},
      {"checkpoints", number(summary.checkpoints)},
      {"checkpoint_seconds", number(summary.checkpoint_seconds)},
      {"checkpoint_bytes", number(static_cast<double>(summary.checkpoint_bytes))},
      {"peak_memory_master_bytes", number(static_cast<double>(summary.peak_memory_master))},
      {"peak_memory_points_bytes", number(static_cast<double>(summary.peak_memory_points))},
      {"case_hash", quoted_text(summary.case_hash)},
      {"date", quoted_text(date)},
      {"host", quoted_text(host)},
      {"command_line", quoted_text(summary.command_line)},
      {"versions", object(versions, "  ")},
  };
  return object(members, "") + "\n";
}

void write_summary(const std::filesystem::path& file, const Summary& summary) {
  std::array<char, 256> host{};
  gethostname(host.data(), host.size() - 1);
  const std::string date = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  replace_file(file, to_json(summary, date, host.data()));
}

std::uint64_t peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

}  // namespace femxdem
