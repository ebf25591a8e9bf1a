#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "output_folder.hpp"

namespace femxdem {

/// One converged step.
struct StepRecord {
  int step = 0;
  double time = 0;         ///< [s]
  double load_factor = 0;  ///< [-]
  int iterations = 0;
  int evaluations = 0;           ///< of all material points, spent on this step, rejected trials included
  double dem_steps = 0;          ///< of all points and evaluations of this step
  std::size_t histories = 0;     ///< different ones among the points (EqualHistories)
  double residual = 0;           ///< relative force residual that was accepted [-]
  double dem_seconds = 0;        ///< inside the DEM engine, all ranks, this step [s]
  double wall_seconds = 0;       ///< since the start of the run [s]
  std::vector<double> monitors;  ///< in the order of the names given to History
};

/// All names of the columns of history.csv; `own`: those of the run, which stand between the residual and the clocks.
std::vector<std::string> history_columns(const std::vector<std::string>& own);

/// history.csv: one row for each converged step, on the disk as soon as it is added. Numbers have 17 digits, so that
/// equal bits give equal text; the columns that depend on the clock come last: dem_seconds, wall_s.
class History {
 public:
  /// With Existing::resume the rows after `last_step` are removed; throws UserError where the columns differ.
  History(const std::filesystem::path& file, const std::vector<std::string>& monitors, Existing existing,
          int last_step = 0);

  /// Throws DiskError where the row cannot be written, or where earlier ones are no longer there.
  void add(const StepRecord& record);

 private:
  std::filesystem::path file_;
  std::size_t monitors_;
  std::optional<AppendedFile> stream_;
};

}  // namespace femxdem
