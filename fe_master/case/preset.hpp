#pragma once

#include "case.hpp"
#include "case_mistakes.hpp"

namespace femxdem {

/// What `ve.preset` gives where the case does not, from the fronts of validation/speed_accuracy, and the relative
/// errors that were measured with it there.
struct Preset {
  const char* name;
  int spheres;
  double inertial_number;
  int min_steps;        ///< ve.min_steps: fewer with small increments, so that the rate stays what it is
  double increment;     ///< nominal strain of a step
  double tolerance;     ///< solver.tolerance
  int elements_across;  ///< advice: elements across a band of the second gradient
  double peak, residual, band, curve;
};

/// Not of VePreset::none.
const Preset& preset(VePreset which);

/// Nominal strain per second of a rectangle whose edges are moved: the sum over its edges of displacement per second
/// over the distance to the opposite edge, where each moves fastest. NaN where the loads do not tell it.
double strain_rate(const Case& c);

/// Gives values of a VE that neither the case nor its region gives; `given`: whether they do, by key of [ve].
template <class Given>
void complete_by_preset(VeParameters& ve, const Given& given) {
  if (ve.preset == VePreset::none) return;
  const Preset& values = preset(ve.preset);
  if (!given("spheres")) ve.spheres = values.spheres;
  if (!given("inertial_number")) ve.inertial_number = values.inertial_number;
  if (!given("min_steps")) ve.min_steps = values.min_steps;
}

/// Gives tolerance and step of a case on volume elements that has a preset, where it does not give them and, for the
/// step, where its strain rate is known.
void complete_by_preset(Case& c, const Mistakes& mistakes);

}  // namespace femxdem
