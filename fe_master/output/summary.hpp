#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace femxdem {

/// How a run ended and what it cost: summary.json.
struct Summary {
  std::string status;   ///< "done", "stopped", "not converged", "failed"
  std::string message;  ///< one sentence
  int exit_status = 0;
  int steps = 0;         ///< converged
  long evaluations = 0;  ///< of all material points
  double dem_steps = 0;  ///< over all points and evaluations
  int ranks = 1;
  int threads = 1;                       ///< of each rank
  std::string engine;                    ///< of volume elements; empty: laws in closed form
  std::string engine_check;              ///< "23 of 23 trials equal YADE's to the bit"; empty: none was repeated
  double wall_seconds = 0;               ///< of the run
  double evaluate_seconds = 0;           ///< wall time inside MaterialPoints::evaluate
  double trial_seconds = 0;              ///< of the points' trials, summed over the ranks
  double engine_seconds = 0;             ///< of which inside the DEM engine's steps
  double balance = 0;                    ///< ideal over actual time of the trials on the ranks, by counted cost
  double imbalance_before = 0;           ///< busiest rank over the mean when points last moved; 0: they never did
  double imbalance_after = 0;            ///< and then
  long moved = 0;                        ///< points, in the whole run
  int checkpoints = 0;                   ///< written
  double checkpoint_seconds = 0;         ///< in all
  std::uint64_t checkpoint_bytes = 0;    ///< of the last file
  std::uint64_t peak_memory_master = 0;  ///< [byte]
  std::uint64_t peak_memory_points = 0;  ///< of all volume elements, see LocalPoints::peak_memory [byte]
  std::string case_hash;
  std::string command_line;
  std::map<std::string, std::string> versions;
};

/// JSON of the summary with what follows from it: `parallel_efficiency` = trial seconds / (ranks x threads x wall
/// seconds of evaluate), `engine_share` = engine seconds / (the same), `overhead_ratio` = 1 - engine_share; null where
/// unknown.
std::string to_json(const Summary& summary, const std::string& date, const std::string& host);

/// A text between quotes as JSON and TOML want it.
std::string quoted_text(std::string_view text);

/// Writes it with the date (UTC, ISO 8601) and the name of this machine.
void write_summary(const std::filesystem::path& file, const Summary& summary);

/// Largest resident memory of this process so far [byte].
std::uint64_t peak_memory();

}  // namespace femxdem
