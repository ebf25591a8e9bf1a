#include "control.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "edge_samples.hpp"
#include "nonlinear_solver.hpp"

namespace femxdem {
namespace {

constexpr double kLimitSlope = 0.2;  // of the steepest: control passes to the measure below it

}  // namespace

ControlMeasure::ControlMeasure(const ControlParameters& parameters, const Formulation& formulation)
    : parameters_(parameters),
      formulation_(formulation),
      weights_(Eigen::VectorXd::Zero(2 * static_cast<Eigen::Index>(formulation.mesh().nodes.size()))) {
  if (parameters_.measure == Measure::volume) return;
  add_mean(parameters_.measure_edge, 1);
  if (!parameters_.against_edge.empty()) add_mean(parameters_.against_edge, -1);
}

/// Adds sign / A int_edge N_a d dA, d the direction that is measured.
void ControlMeasure::add_mean(const std::string& edge, double sign) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(weights_.size());
  double area = 0;
  for (const EdgeSample& g : edge_samples(formulation_.mesh(), edge)) {
    const double dA = g.weight * g.tangent.norm() * formulation_.thickness(g.position);
    Point2 direction = -outward_normal(g.tangent).normalized();
    if (parameters_.measure == Measure::displacement_x) direction = Point2::UnitX();
    if (parameters_.measure == Measure::displacement_y) direction = Point2::UnitY();
    for (int a = 0; a < 3; ++a) sum.segment<2>(2 * g.nodes[a]) += dA * g.N[a] * direction;
    area += dA;
  }
  weights_ += sign / area * sum;
}

/// Volume on the outer side of the edge at the unknowns x, and its derivative where it is asked for.
double ControlMeasure::swept_volume(const Eigen::VectorXd& x, Eigen::VectorXd* gradient) const {
  double volume = 0;
  for (const EdgeSample& g : edge_samples(formulation_.mesh(), parameters_.measure_edge, x)) {
    const SweptVolume swept = formulation_.swept_volume(g.position, g.tangent);
    volume += g.weight * swept.value;
    if (gradient == nullptr) continue;
    for (int a = 0; a < 3; ++a)
      gradient->segment<2>(2 * g.nodes[a]) += g.weight * (g.N[a] * swept.by_position + g.dN[a] * swept.by_tangent);
  }
  return volume;
}

double ControlMeasure::value(const Eigen::VectorXd& x) const {
  if (parameters_.measure != Measure::volume) return weights_.dot(x.head(weights_.size()));
  return swept_volume(x, nullptr) - swept_volume(Eigen::VectorXd::Zero(x.size()), nullptr);
}

Eigen::VectorXd ControlMeasure::gradient(const Eigen::VectorXd& x) const {
  Eigen::VectorXd c = Eigen::VectorXd::Zero(x.size());
  if (parameters_.measure == Measure::volume) {
    swept_volume(x, &c);
  } else {
    c.head(weights_.size()) = weights_;
  }
  return c;
}

StepControl::StepControl(const ControlParameters& parameters, const Formulation& formulation)
    : parameters_(parameters),
      by_measure_(parameters.mode == ControlMode::measure),
      rate_(by_measure_ ? parameters.rate : 0) {
  if (parameters.mode != ControlMode::time) measure_.emplace(parameters, formulation);
}

std::optional<MeasureTarget> StepControl::target(const Equilibrium& committed, double dt) const {
  if (!by_measure_) return std::nullopt;
  return MeasureTarget{&*measure_, measure_->value(committed.x) + rate_ * dt};
}

bool StepControl::accepted(const Equilibrium& before, const Equilibrium& now) {
  if (!measure_ || by_measure_) return false;
  const double rise = measure_->value(now.x) - measure_->value(before.x);
  rate_ = rise / (now.time - before.time);
  if (rise == 0) return false;
  const double slope = std::abs((now.load_factor - before.load_factor) / rise);
  steepest_ = std::max(steepest_, slope);
  by_measure_ = can_switch() && slope < kLimitSlope * steepest_;
  return by_measure_;
}

bool StepControl::rejected() {
  if (!can_switch()) return false;
  by_measure_ = true;
  return true;
}

std::string StepControl::description() const {
  constexpr std::array<const char*, 4> kNames = {"mean displacement in x", "mean displacement in y", "opening",
                                                 "volume"};
  return fmt::format("{} of edge '{}' at {:.3g} {}/s", kNames.at(static_cast<std::size_t>(parameters_.measure)),
                     parameters_.measure_edge, rate_, measure_->unit());
}

void StepControl::save(NamedArrays& arrays) const {
  arrays.emplace_back("control", std::vector<double>{by_measure_ ? 1.0 : 0.0, rate_, steepest_});
}

void StepControl::load(const NamedArrays& arrays) {
  const auto& values = find_array(arrays, "control");
  by_measure_ = values.at(0) != 0;
  rate_ = values.at(1);
  steepest_ = values.at(2);
}

}  // namespace femxdem
