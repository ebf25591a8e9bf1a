#include "log.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>

#include "seconds_since.hpp"

namespace femxdem {
namespace {

/// Whether a line of progress can be written over. Under mpirun, standard output is a terminal of mpirun's own, whose
/// text goes who knows where; a scheduler's job writes to a file.
bool shows_updates(std::FILE* terminal, std::optional<bool> asked) {
  if (asked) return *asked;
  for (const char* batch : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_JOB_ID", "PBS_JOBID", "LSB_JOBID", "JOB_ID"})
    if (std::getenv(batch) != nullptr) return false;
  const char* kind = std::getenv("TERM");
  return isatty(fileno(terminal)) == 1 && kind != nullptr && std::string_view(kind) != "dumb";
}

}  // namespace

std::string readable_duration(double seconds) {
  if (!std::isfinite(seconds)) return "unknown";
  if (seconds < 120) return fmt::format("{:.0f} s", seconds);
  if (seconds < 7200) return fmt::format("{:.0f} min", seconds / 60);
  return fmt::format("{:.1f} h", seconds / 3600);
}

Log::Log(const std::filesystem::path& file, Existing existing, std::FILE* terminal, std::optional<bool> progress)
    : stream_(file, existing == Existing::resume), terminal_(terminal), updates_(shows_updates(terminal, progress)) {}

Log::~Log() { end_progress_line(); }

void Log::end_progress_line() {
  if (line_is_open_) print("\n");
  line_is_open_ = false;
  std::fflush(terminal_);
}

void Log::say(std::string_view line) {
  end_progress_line();
  print(fmt::format("{}\n", line));
  note(line);
}

/// A log that somebody has removed begins anew: it is no result.
void Log::note(std::string_view line) {
  if (!stream_.is_in_place()) stream_.open_again();
  stream_.write(fmt::format("{}\n", line));
}

/// A terminal that cannot be written stops no run.
void Log::print(std::string_view text) {
  std::fwrite(text.data(), 1, text.size(), terminal_);
  std::fflush(terminal_);
}

double Log::seconds_left(double done) {
  const double elapsed = seconds_since(start_);
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
  print(fmt::format("\r{}\033[K", line));
  line_is_open_ = true;
  note(line);
}

}  // namespace femxdem
