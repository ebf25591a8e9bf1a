#pragma once

#include <mpi.h>

#include <cstdint>
#include <string>
#include <vector>

#include "equal_histories.hpp"
#include "material_points.hpp"

namespace femxdem {

/// What sharing the points out anew has found and done. Loads of the busiest rank over the mean.
struct Balance {
  double before = 1, after = 1;
  std::size_t moved = 0;
  double seconds = 0;               ///< wall time of the moves
  double counted = 1, clocked = 1;  ///< mean rank's trials over the busiest one's in the batches since the last time
  double working = 1;               ///< trials of all processors over the wall time of those batches
};

/// As a sentence.
std::string describe(const Balance& balance, std::size_t points);

/// What the evaluations have cost so far.
struct FarmStatistics {
  long batches = 0;             ///< calls of evaluate
  long evaluations = 0;         ///< points answered
  double dem_steps = 0;         ///< summed over the points
  double seconds = 0;           ///< wall time inside evaluate on rank 0
  double trial_seconds = 0;     ///< of the points' trials, summed
  double engine_seconds = 0;    ///< of which inside the DEM engine's steps
  std::uint64_t bytes = 0;      ///< sent between the ranks by evaluate
  double cost = 0;              ///< of all trials: DEM steps x contacts
  double critical_cost = 0;     ///< of the busiest rank of each batch, summed
  double critical_seconds = 0;  ///< the same of its trials' times
  long moved = 0;               ///< points that went to another rank
  double move_seconds = 0;      ///< wall time of that on rank 0
  Balance last_move;

  /// Mean rank over the busiest one in the batches since then, by cost and by the clock; 1 where there were none.
  double efficiency(const FarmStatistics& then, int ranks) const {
    const double spent = ranks * (critical_cost - then.critical_cost);
    return spent > 0 ? (cost - then.cost) / spent : 1;
  }
  double clock_efficiency(const FarmStatistics& then, int ranks) const {
    const double spent = ranks * (critical_seconds - then.critical_seconds);
    return spent > 0 ? (trial_seconds - then.trial_seconds) / spent : 1;
  }
  double working_share(const FarmStatistics& then, int processors) const {
    const double spent = processors * (seconds - then.seconds);
    return spent > 0 ? (trial_seconds - then.trial_seconds) / spent : 1;
  }
};

/// The points of all ranks as one batch, on rank 0. Every rank, 0 included, serves its own share; the others are in
/// serve() until this object is destroyed. Results do not depend on the number of ranks, nor on who serves which point.
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

  std::size_t size() const override { return latest_.size(); }
  std::size_t distinct() const override { return distinct_; }
  std::vector<int> histories() const override { return histories_.committed(); }
  void begin_step() override;
  std::vector<Response> evaluate(std::span<const Tensor2> F, Operator wanted) override;
  void commit() override;
  std::vector<PointReport> reports() override;
  /// Ranks hand over one state after another, rank 0 holds one of each.
  void save_each(const TakeState& take) override;
  void load_each(const StateSource& states) override;

  /// From now on points also move before the first trial of a step, where their ranks can tell what it will cost
  /// (LocalPoints::costs) and a step of as many trials as the last one had pays for it (relieve).
  void balance_each_step() { each_step_ = true; }
  /// Directly after save(): shares the points out by what each has cost, where that pays (rebalance); costs since the
  /// last time are the latest, older ones count half each time. The cost is counted (DEM steps x contacts), not
  /// measured: it repeats. Points with equal histories may share one cell as long as they are on one rank: while more
  /// than a tenth of them do, all stay where they are, as they do without may_move.
  Balance balance(bool may_move = true);

  const FarmStatistics& statistics() const { return statistics_; }
  /// Sums over the ranks of what LocalPoints count. Collective with serve().
  struct Account {
    std::uint64_t peak_memory = 0;  ///< [byte]
    EngineCheck check;
  };
  Account account();

 private:
  void count(const std::vector<Response>& responses, double seconds);
  std::vector<int> owners() const;
  bool shared() const;
  void relieve_ranks(std::span<const Tensor2> F);
  std::size_t move_to(const std::vector<int>& owner);

  MPI_Comm communicator_;
  LocalPoints& local_;
  std::vector<std::vector<std::size_t>> shares_;  ///< points of each rank, in its order
  std::vector<double> latest_, older_;            ///< costs of each point since the last balance(), and before
  EqualHistories histories_;
  std::size_t distinct_ = 0;
  bool each_step_ = false;
  long trials_of_step_ = 0, trials_of_last_step_ = 0;
  FarmStatistics statistics_, at_last_balance_;
};

}  // namespace femxdem
