#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "material_points.hpp"
#include "straining.hpp"
#include "ve_state.hpp"
#include "worker_process.hpp"

namespace femxdem {

/// The volume elements of ONE rank: scenes that live in its worker process.
///
/// They are strained and judged as straining.hpp says. Between load steps the time step dt follows the contact network,
/// looked at whenever |ln U_n| passes a multiple of 0.02 or the pressure a power of 2: a rule of the states alone, so
/// that a run that goes on from a checkpoint keeps its bits.
class PythonVolumeElements : public LocalPoints {
 public:
  PythonVolumeElements(WorkerProcess& worker, VolumeElementOptions options);

  /// A volume element as it starts: its state and how it was made.
  struct Template {
    std::string state;
    std::string manifest;  ///< JSON
  };
  /// Prepares, loads or runs what `specification_json` (the [ve] table) says, in a process of its own: a crash or an
  /// endless script is a UserError, as is every mistake that the engine names.
  Template make_template(const std::string& specification_json);
  /// Versions of the engine and of Python, JSON.
  std::string versions();
  /// Time step, time scale, size of volume element `index` when it was added, saved or loaded.
  VeInfo info(std::size_t index) { return worker_.slot(index).info; }

  /// Throws UserError for a state without pressure: it has no time scale.
  void add(const std::string& state, std::size_t count) override;
  void remove(std::size_t index) override;
  std::string save_one(std::size_t index) override;
  std::uint64_t peak_memory() const override { return peak_memory_; }
  std::size_t size() const override { return points_.size(); }
  void begin_step() override;
  /// Throws UserError for Operator::tangent, WorkerLost if the worker is gone.
  std::vector<Response> evaluate(std::span<const Tensor2> F, Operator wanted) override;
  /// Throws std::logic_error without a trial or after a trial that failed.
  void commit() override;
  std::vector<PointReport> reports() override;
  void save_each(const TakeState& take) override;
  void load_into(std::span<const std::size_t> points, const std::string& state) override;

 private:
  Straining plan(std::size_t index, const Tensor2& F);
  double patience(const std::vector<Straining>& plans) const;  ///< with one volume element of the next trial [s]
  void note_cost(const std::vector<Straining>& plans);
  void run_trial(bool with_stiffness, std::vector<Response>& responses);
  void fail_after_deaths(std::vector<Response>& responses, std::vector<int>& deaths, std::int64_t status);
  void read(std::size_t index, const Straining& straining, Operator wanted, Response& response);
  void drop_trial();
  NetworkLevel level(std::size_t index);  ///< of what stands in its slot
  void adopt_state(std::size_t index);
  void keep_report(std::size_t index);

  WorkerProcess& worker_;
  VolumeElementOptions options_;
  std::vector<StrainedPoint> points_;
  std::vector<PointReport> reports_;  ///< of the trials that were committed; a later one overwrites its slot
  std::uint64_t peak_memory_ = 0;
  double seconds_per_step_ = 0;  ///< most that a DEM step has taken so far [s]
  bool trial_pending_ = false;
  bool trial_failed_ = false;
  bool with_stiffness_ = false;  ///< the pending trial
  bool said_serialised_ = false;
};

}  // namespace femxdem
