#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "case.hpp"
#include "end_request.hpp"
#include "errors.hpp"
#include "history.hpp"
#include "log.hpp"
#include "named_arrays.hpp"
#include "output_folder.hpp"
#include "seconds_since.hpp"
#include "summary.hpp"

namespace femxdem {

/// Where and how a case is run.
struct RunOptions {
  std::filesystem::path folder;
  Existing existing = Existing::refuse;  ///< resume: go on from checkpoint.h5 of the folder
  int ranks = 1;
  std::string command_line;
  std::map<std::string, std::string> versions;
  std::vector<std::string> remarks;   ///< for log.txt: the engine; what was adopted, dropped, reset
  std::shared_ptr<FolderLock> lock;   ///< of the folder where it is prepared already
  std::optional<Moment> ends_before;  ///< the process must have ended by then
  std::optional<bool> progress;       ///< see Log
  /// After a checkpoint: shares the points out anew; returns what the log says of it, mostly nothing.
  std::function<std::string()> at_checkpoint = [] { return std::string(); };
  std::function<void(Summary&)> complete = [](Summary&) {};  ///< adds what the farm knows
};

/// What every run of steps writes, a boundary value problem or the path of one point: log.txt, case.toml (the effective
/// case), history.csv and, at the end, summary.json.
class RunFiles {
 public:
  /// Prepares the folder and holds its lock. options is kept by reference.
  RunFiles(const Case& c, const RunOptions& options);

  /// history.csv with these columns of its own; rows after last_step of an earlier run are removed.
  void begin_history(const std::vector<std::string>& columns, int last_step = 0);
  /// A converged step, or the state before the first: its row and its share of the sums.
  void add(const StepRecord& record);
  /// The sums so far, for a checkpoint.
  void save(NamedArrays& arrays) const;
  /// Goes on after this step with the sums of its checkpoint.
  void load(int step, const NamedArrays& arrays);
  /// Writes the summary and says the message. Returns the status.
  int finish(int status, const std::string& message);
  /// Wall time since the start [s].
  double wall() const { return seconds_since(start_); }

  /// What a full disk leaves: how the run ended, if it still finds a place. Returns the sentence.
  std::string stopped_by_the_disk(const std::string& reason);
  /// Every file has what it should of the last step, which ended at `time`.
  void whole(double time);
  /// There is a checkpoint of the last step on the disk.
  void checkpoint_written() { last_checkpoint_ = summary.steps; }
  /// Its step; nothing where there is none.
  std::optional<int> last_checkpoint() const { return last_checkpoint_; }

 private:
  std::shared_ptr<FolderLock> lock_;  // before any file in the folder

 public:
  Log log;
  Summary summary;

 private:
  const RunOptions& options_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::optional<History> history_;
  int whole_step_ = 0;
  std::optional<int> last_checkpoint_;
  double whole_time_ = 0;
};

}  // namespace femxdem
