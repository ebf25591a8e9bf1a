#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "compact_cell.hpp"
#include "referee.hpp"
#include "straining.hpp"
#include "ve_state.hpp"

namespace femxdem {

/// How the compact volume elements of a rank are shared out and checked.
struct CompactOptions {
  int threads = 1;
  double check_share = 0;          ///< of the trials that YADE repeats, at random [-]
  std::filesystem::path evidence;  ///< folder for the data of a trial that YADE answers otherwise
};

/// A trial that YADE answers otherwise: the run cannot be trusted.
struct EngineDiffers : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The volume elements of ONE rank as compact cells, strained by its threads. Points with equal histories (same start,
/// stretches equal up to kQuantum since then) share one cell; the first trial in which they part gives each its own.
/// What the last trial has strained already is not strained again (its report counts no steps): equal F, equal bits.
/// Results depend neither on the number of threads nor on which points a rank holds.
class CompactVolumeElements : public LocalPoints {
 public:
  CompactVolumeElements(WorkerProcess& worker, VolumeElementOptions options, CompactOptions compact);

  /// Throws UserError for a scene that compact cells do not cover.
  void add(const std::string& state, std::size_t count) override;
  void remove(std::size_t index) override;
  std::size_t size() const override { return points_.size(); }
  void begin_step() override;
  /// Throws EngineDiffers.
  std::vector<double> costs(std::span<const Tensor2> F) const override;
  std::vector<Response> evaluate(std::span<const Tensor2> F, Operator wanted) override;
  void commit() override;
  std::vector<PointReport> reports() override;
  void save_each(const TakeState& take) override;
  std::string save_one(std::size_t index) override;
  void load_into(std::span<const std::size_t> points, const std::string& state) override;
  std::uint64_t peak_memory() const override { return peak_memory_; }
  EngineCheck engine_check() const override { return check_; }
  int threads() const override { return compact_.threads; }

 private:
  using Cell = std::shared_ptr<CompactCell>;
  struct Point {
    Cell cell;
    StrainedPoint strained;
    double time_step = 0;  ///< [s]
    PointReport report;    ///< of the last commit, complete
  };
  /// What one cell is asked for by one or more points.
  struct Trial {
    Cell cell;
    const CompactCell* from = nullptr;  ///< the committed one; none: refused
    bool kept = false;                  ///< it is the last trial's
    std::size_t first = 0;              ///< of its points
    Straining straining;
    std::optional<std::string> failure;
    Strained found;
    PointReport report;
    bool checked = false;
  };

  Point point_of(const std::string& state);
  void adopt(Point& point, const Tensor2& stress) const;
  Cell spare_cell();
  std::vector<std::size_t> longest_first() const;
  void group(const std::vector<Straining>& plans);
  void give_cells(std::vector<Trial> last);
  void strain(Trial& trial, Operator wanted) const;
  void deform(Trial& trial) const;
  void check(const Trial& trial);
  template <class Work>
  void in_parallel(std::size_t count, Work work) const;
  void count_memory();

  WorkerProcess& worker_;
  VolumeElementOptions options_;
  CompactOptions compact_;
  Referee referee_;
  std::vector<Point> points_;
  std::vector<Trial> trials_;
  std::vector<std::size_t> trial_of_point_;
  std::vector<Cell> spare_;
  std::uint64_t drawn_ = 0;  ///< trials so far, for the sample that is checked
  EngineCheck check_;
  std::uint64_t peak_memory_ = 0;
  bool trial_pending_ = false, trial_failed_ = false;
};

}  // namespace femxdem
