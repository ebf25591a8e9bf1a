#pragma once

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "history.hpp"

namespace femxdem {

/// One row of a step's table.
struct IterationRecord {
  int iteration = 0;
  double residual = 0;          ///< |r| / |f| [-]
  double correction = 0;        ///< |du| / |u| [-]
  double dem_seconds_max = 0;   ///< of the slowest point [s]
  double dem_seconds_mean = 0;  ///< over the points [s]
  double solve_seconds = 0;     ///< assembly and solution
  int element = 0;              ///< farthest out of balance
  std::string note;             ///< such as "cut" or the point that failed; mostly empty
};

/// What the run says: everything goes to log.txt, the essential also to the terminal. A terminal shows the progress on
/// one line that updates; a batch log gets one plain line for each step. Throws DiskError where log.txt cannot be
/// written.
class Log {
 public:
  /// With Existing::resume the text of the earlier run is kept. `progress`: whether the line updates; if not given,
  /// where `terminal` is one that nobody else writes for, neither mpirun nor a scheduler.
  Log(const std::filesystem::path& file, Existing existing, std::FILE* terminal = stdout,
      std::optional<bool> progress = {});
  ~Log();
  Log(const Log&) = delete;
  Log& operator=(const Log&) = delete;

  /// A line for log.txt and the terminal.
  void say(std::string_view line);
  /// A line for log.txt alone.
  void note(std::string_view line);
  /// Fraction of the whole run that was done before, for the estimate of the time left; 0 unless restarted.
  void start_from(double done) { done_at_start_ = done; }
  /// A converged step: its table to log.txt, its line to both. `done`: fraction of the whole run, 0 to 1.
  void step(const StepRecord& record, std::span<const IterationRecord> iterations, double done);

 private:
  double seconds_left(double done);
  void end_progress_line();

  void print(std::string_view text);

  AppendedFile stream_;
  std::FILE* terminal_;
  bool updates_;  ///< the terminal can rewrite its line
  bool line_is_open_ = false;
  double done_at_start_ = 0;  ///< fraction of the run
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// A duration for people: "42 s", "12 min", "3.4 h".
std::string readable_duration(double seconds);

}  // namespace femxdem
