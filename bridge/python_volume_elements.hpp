#pragma once

#include <array>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "volume_elements.hpp"
#include "worker_process.hpp"

namespace femxdem {

/// How the volume elements of a rank are strained and judged.
struct VolumeElementOptions {
  double inertial_number = 5e-3;      ///< I = rate a sqrt(rho / p) of a trial [-]
  int min_steps = 10;                 ///< least DEM steps of a trial that strains
  bool freeze_steps = true;           ///< a load step's trials take as many DEM steps as its first
  double max_unbalanced_force = 0.2;  ///< an answer above is refused [-]
  double max_increment = 0.2;         ///< largest |ln U_inc| of one trial [-]
  bool relaxed = false;               ///< the elastic stiffness is the relaxed one, not Eq. (2)
  bool serialise = false;             ///< no fork: states are saved and restored at every trial
  /// Where remarks go: a trial that was repeated, a fork that was refused.
  std::function<void(std::string_view)> say = [](std::string_view) {};
};

/// The volume elements of ONE rank: scenes that live in its worker process.
///
/// The cell is driven along the stretch only: F = R U, from the committed stretch U_n as measured to U along
/// L = (U_inc^(1/n) - I) / dt, U_inc = U U_n^-1, and the answer is rotated by R. The number of steps
/// n = max(min_steps, |ln U_inc| / (rate dt)), rate = I / (a sqrt(rho / p)) with the pressure of the state that was
/// added, is frozen from the first trial of a load step on (unless a later one would need more than twice as many), so
/// that the response is a smooth function of F. Between load steps the time step dt follows the contact network, looked
/// at whenever |ln U_n| passes a multiple of 0.02 or the pressure a power of 2: a rule of the states alone, so that
/// a run that goes on from a checkpoint keeps its bits.
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
  std::uint64_t peak_memory() const override { return peak_memory_; }
  std::size_t size() const override { return committed_stretch_.size(); }
  void begin_step() override;
  /// Throws UserError for Operator::tangent, WorkerLost if the worker is gone.
  std::vector<Response> evaluate(std::span<const Tensor2> F, Operator wanted) override;
  /// Throws std::logic_error without a trial or after a trial that failed.
  void commit() override;
  std::vector<PointReport> reports() const override;
  SavedStates save() override;
  void load(const SavedStates& states) override;

 private:
  struct Plan;
  using NetworkLevel = std::array<int, 2>;  ///< of strain and of pressure
  Plan plan(std::size_t index, const Tensor2& F);
  void run_trial(bool with_stiffness, std::vector<Response>& responses);
  void fail_after_deaths(std::vector<Response>& responses, std::vector<int>& deaths, std::int64_t status);
  void read(std::size_t index, const Plan& plan, Operator wanted, Response& response);
  void drop_trial();
  void adopt_state(std::size_t index);

  WorkerProcess& worker_;
  VolumeElementOptions options_;
  std::vector<Tensor2> committed_stretch_;
  std::vector<NetworkLevel> committed_level_;
  std::vector<double> reference_time_scale_;  ///< a sqrt(rho / p) when it was added [s]
  std::vector<long> frozen_steps_;            ///< 0: to be chosen at the next trial
  std::uint64_t peak_memory_ = 0;
  bool trial_pending_ = false;
  bool trial_failed_ = false;
  bool with_stiffness_ = false;  ///< the pending trial
  bool said_serialised_ = false;
};

}  // namespace femxdem
