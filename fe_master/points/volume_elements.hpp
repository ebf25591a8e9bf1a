#pragma once

#include <mpi.h>

#include <cstdint>
#include <string>
#include <vector>

#include "equal_histories.hpp"
#include "material_points.hpp"

namespace femxdem {

/// What the evaluations have cost so far.
struct FarmStatistics {
  long batches = 0;           ///< calls of evaluate
  long evaluations = 0;       ///< points answered
  double dem_steps = 0;       ///< summed over the points
  double seconds = 0;         ///< wall time inside evaluate on rank 0
  double trial_seconds = 0;   ///< of the points' trials, summed
  double engine_seconds = 0;  ///< of which inside the DEM engine's steps
  std::uint64_t bytes = 0;    ///< sent between the ranks by evaluate
};

/// The points of all ranks as one batch, on rank 0. Every rank, 0 included, serves its own share; the others are in
/// serve() until this object is destroyed. Results do not depend on the number of ranks.
///
/// An exception on one rank never skips a collective: it travels to rank 0 as a value and is thrown there, once all
/// ranks have answered, as UserError if it was one and std::runtime_error otherwise, with the rank's number.
class VolumeElements : public MaterialPoints {
 public:
  /// Point p starts in state templates[template_of_point[p]]. Collective with serve() on the other ranks.
  VolumeElements(MPI_Comm communicator, LocalPoints& local, const std::vector<std::string>& templates,
                 const std::vector<int>& template_of_point);
  /// Ends serve() on the other ranks.
  ~VolumeElements() override;
  VolumeElements(const VolumeElements&) = delete;
  VolumeElements& operator=(const VolumeElements&) = delete;

  std::size_t size() const override { return owner_.size(); }
  std::size_t distinct() const override { return distinct_; }
  void begin_step() override;
  std::vector<Response> evaluate(std::span<const Tensor2> F, Operator wanted) override;
  void commit() override;
  std::vector<PointReport> reports() const override { return reports_; }
  /// Ranks hand over one state after another, rank 0 holds one of each.
  void save_each(const TakeState& take) override;
  void load_each(const StateSource& states) override;

  const FarmStatistics& statistics() const { return statistics_; }
  /// Sums over the ranks of what LocalPoints count. Collective with serve().
  struct Account {
    std::uint64_t peak_memory = 0;  ///< [byte]
    EngineCheck check;
  };
  Account account();

 private:
  std::vector<std::vector<std::size_t>> points_of_ranks() const;
  void count(const std::vector<Response>& responses, double seconds);

  MPI_Comm communicator_;
  LocalPoints& local_;
  std::vector<int> owner_;            ///< rank of each point
  std::vector<PointReport> reports_;  ///< of the last commit
  EqualHistories histories_;
  std::size_t distinct_ = 0;
  FarmStatistics statistics_;
};

/// Serves the local points of a rank other than 0 until rank 0 destroys its VolumeElements.
void serve(MPI_Comm communicator, LocalPoints& local);

}  // namespace femxdem
