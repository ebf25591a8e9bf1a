#include "log.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>

namespace femxdem {

std::string readable_duration(double seconds) {
  if (!std::isfinite(seconds)) return "unknown";
  if (seconds < 120) return fmt::format("{:.0f} s", seconds);
  if (seconds < 7200) return fmt::format("{:.0f} min", seconds / 60);
  return fmt::format("{:.1f} h", seconds / 3600);
}

Log::Log(const std::filesystem::path& file, Existing existing, std::FILE* terminal)
    : stream_(file, existing == Existing::resume ? std::ios::app : std::ios::trunc),
      terminal_(terminal),
      updates_(isatty(fileno(terminal)) == 1) {}

Log::~Log() { end_progress_line(); }

void Log::end_progress_line() {
  if (line_is_open_) fmt::print(terminal_, "\n");
  line_is_open_ = false;
  std::fflush(terminal_);
}

void Log::say(std::string_view line) {
  end_progress_line();
  fmt::print(terminal_, "{}\n", line);
  std::fflush(terminal_);
  note(line);
}

void Log::note(std::string_view line) { stream_ << line << std::endl; }

double Log::seconds_left(double done) {
  const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  return elapsed * (1 - done) / (done - done_at_start_);
}

void Log::step(const StepRecord& record, std::span<const IterationRecord> iterations, double done) {
  note(fmt::format("{:>4} {:>10} {:>10} {:>10} {:>10} {:>10} {:>10}", "it", "|r|/|f|", "|du|/|u|", "DEM max s",
                   "DEM mean s", "solve s", "element"));
  for (const IterationRecord& row : iterations) {
    note(fmt::format("{:>4} {:>10.2e} {:>10.2e} {:>10.3f} {:>10.3f} {:>10.4f} {:>10} {}", row.iteration, row.residual,
                     row.correction, row.dem_seconds_max, row.dem_seconds_mean, row.solve_seconds, row.element,
                     row.note));
  }
  const std::string left = done > done_at_start_ ? readable_duration(seconds_left(done)) : "unknown";
  const std::string line = fmt::format(
      "step {:>4}  time {:<9.4g}  load {:<7.4g}  iterations {:>2}  evaluations {:>2}  residual {:.1e}  DEM {:.1f} s  "
      "left {}",
      record.step, record.time, record.load_factor, record.iterations, record.evaluations, record.residual,
      record.dem_seconds, left);
  if (!updates_) return say(line);
  fmt::print(terminal_, "\r{}\033[K", line);
  std::fflush(terminal_);
  line_is_open_ = true;
  note(line);
}

}  // namespace femxdem
