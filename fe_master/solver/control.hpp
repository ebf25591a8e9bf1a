#pragma once

#include <optional>
#include <string>

#include "control_parameters.hpp"
#include "formulation.hpp"

namespace femxdem {

struct Equilibrium;

/// A scalar measure m of the displacements of an edge that can be prescribed in place of the factor of loads:
///   displacement_x, displacement_y: mean over the edge (per area that the formulation gives it) [m];
///   opening: mean displacement against the outward normal of the undeformed edge, a cavity that widens is positive
///   [m];
///   volume: growth of the volume on the edge's outer side (Formulation::swept_volume), in plane strain swept about the
///   origin and per thickness [m^2], exact for an arc whose ends move on rays through the origin; axisymmetric [m^3].
/// With against_edge, the same mean of that edge is subtracted (indirect control across a band).
class ControlMeasure {
 public:
  /// formulation is kept by reference.
  ControlMeasure(const ControlParameters& parameters, const Formulation& formulation);

  double value(const Eigen::VectorXd& x) const;
  /// Of the value.
  const char* unit() const { return parameters_.measure == Measure::volume ? formulation_.volume_unit() : "m"; }
  /// dm/dx, of the size of x.
  Eigen::VectorXd gradient(const Eigen::VectorXd& x) const;

 private:
  void add_mean(const std::string& edge, double sign);
  double swept_volume(const Eigen::VectorXd& x, Eigen::VectorXd* gradient) const;

  ControlParameters parameters_;
  const Formulation& formulation_;
  Eigen::VectorXd weights_;  // of the nodal displacements in a linear measure
};

/// A measure and the value that it must have at the end of a step.
struct MeasureTarget {
  const ControlMeasure* measure;
  double value;
};

/// What drives the steps: time (loads and displacements follow their tables), or a measure of the displacements, while
/// the factor of the loads named in the case is found with the unknowns (bordered system: Batoz and Dhatt 1979).
/// Automatic control starts by time and passes to the measure near a limit point, at the rate that it then has.
class StepControl {
 public:
  StepControl(const ControlParameters& parameters, const Formulation& formulation);

  /// Target of a step of dt from the committed state; none under control by time.
  std::optional<MeasureTarget> target(const Equilibrium& committed, double dt) const;
  /// Takes note of a converged step. True when control passes to the measure: the load's rise over the measure's has
  /// fallen below a fifth of the steepest one.
  bool accepted(const Equilibrium& before, const Equilibrium& now);
  /// Takes note of a failed step. True when control passes to the measure, and the step is to be tried again.
  bool rejected();
  /// The measure in words, and its rate once it is in control.
  std::string description() const;

  void save(NamedArrays& arrays) const;
  void load(const NamedArrays& arrays);

 private:
  bool can_switch() const { return parameters_.mode == ControlMode::automatic && !by_measure_ && rate_ != 0; }

  ControlParameters parameters_;
  std::optional<ControlMeasure> measure_;  // where the case names one
  bool by_measure_;
  double rate_;          // of the measure in the last step [m/s, m^2/s, m^3/s]
  double steepest_ = 0;  // largest rise of the load factor over that of the measure
};

}  // namespace femxdem
