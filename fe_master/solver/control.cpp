#include "control.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "nonlinear_solver.hpp"

namespace femxdem {
namespace {

constexpr double kLimitSlope = 0.2;  // of the steepest: control passes to the measure below it

Point2 outward_normal(const Point2& tangent) { return {tangent.y(), -tangent.x()}; }  // material on the left

double cross(const Point2& a, const Point2& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

ControlMeasure::ControlMeasure(const ControlParameters& parameters, const Mesh& mesh)
    : parameters_(parameters),
      mesh_(mesh),
      weights_(Eigen::VectorXd::Zero(2 * static_cast<Eigen::Index>(mesh.nodes.size()))) {
  if (parameters_.measure == Measure::volume) return;
  add_mean(parameters_.measure_edge, 1);
  if (!parameters_.against_edge.empty()) add_mean(parameters_.against_edge, -1);
}

/// Adds sign / L int_edge N_a d ds, d the direction that is measured.
void ControlMeasure::add_mean(const std::string& edge, double sign) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(weights_.size());
  double length = 0;
  for (const Side& side : mesh_.edges.at(edge)) {
    for (const EdgePoint& g : gauss_edge()) {
      const Eigen::Vector3d N = shape_edge(g.s), dN = shape_gradient_edge(g.s);
      Point2 tangent = Point2::Zero();
      for (int a = 0; a < 3; ++a) tangent += dN[a] * mesh_.nodes[side.nodes[a]];
      const double ds = g.weight * tangent.norm();
      Point2 direction = -outward_normal(tangent).normalized();
      if (parameters_.measure == Measure::displacement_x) direction = Point2::UnitX();
      if (parameters_.measure == Measure::displacement_y) direction = Point2::UnitY();
      for (int a = 0; a < 3; ++a) sum.segment<2>(2 * side.nodes[a]) += ds * N[a] * direction;
      length += ds;
    }
  }
  weights_ += sign / length * sum;
}

/// -1/2 int x cross dx along the edge, which has the material on its left, and its derivative.
double ControlMeasure::swept_area(const Eigen::VectorXd& x, Eigen::VectorXd* gradient) const {
  double area = 0;
  for (const Side& side : mesh_.edges.at(parameters_.measure_edge)) {
    for (const EdgePoint& g : gauss_edge()) {
      const Eigen::Vector3d N = shape_edge(g.s), dN = shape_gradient_edge(g.s);
      Point2 position = Point2::Zero(), tangent = Point2::Zero();
      for (int a = 0; a < 3; ++a) {
        const Point2 node = mesh_.nodes[side.nodes[a]] + Point2(x.segment<2>(2 * side.nodes[a]));
        position += N[a] * node;
        tangent += dN[a] * node;
      }
      area -= 0.5 * g.weight * cross(position, tangent);
      if (gradient == nullptr) continue;
      for (int a = 0; a < 3; ++a) {
        // d(position cross tangent) = N_a (du cross tangent) + dN_a (position cross du)
        gradient->segment<2>(2 * side.nodes[a]) -=
            0.5 * g.weight * (N[a] * outward_normal(tangent) - dN[a] * outward_normal(position));
      }
    }
  }
  return area;
}

double ControlMeasure::value(const Eigen::VectorXd& x) const {
  if (parameters_.measure != Measure::volume) return weights_.dot(x.head(weights_.size()));
  return swept_area(x, nullptr) - swept_area(Eigen::VectorXd::Zero(x.size()), nullptr);
}

Eigen::VectorXd ControlMeasure::gradient(const Eigen::VectorXd& x) const {
  Eigen::VectorXd c = Eigen::VectorXd::Zero(x.size());
  if (parameters_.measure == Measure::volume) {
    swept_area(x, &c);
  } else {
    c.head(weights_.size()) = weights_;
  }
  return c;
}

StepControl::StepControl(const ControlParameters& parameters, const Mesh& mesh)
    : parameters_(parameters),
      by_measure_(parameters.mode == ControlMode::measure),
      rate_(by_measure_ ? parameters.rate : 0) {
  if (parameters.mode != ControlMode::time) measure_.emplace(parameters, mesh);
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
                     parameters_.measure_edge, rate_, parameters_.measure == Measure::volume ? "m2" : "m");
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
