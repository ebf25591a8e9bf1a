#include "problem.hpp"

#include <fmt/format.h>

#include <numeric>
#include <stdexcept>

#include "plane_strain_q8.hpp"

namespace femxdem {
namespace {

std::unique_ptr<Formulation> make(const Mesh& mesh, const std::optional<DoubleStiffness>& law) {
  if (!law) return std::make_unique<PlaneStrainQ8>(mesh);
  return std::make_unique<SecondGradientQ8>(mesh, *law);
}

}  // namespace

Problem::Problem(Mesh mesh, const AnalyticLaw& law, const std::optional<DoubleStiffness>& double_stiffness)
    : mesh_(std::move(mesh)),
      element_(make(mesh_, double_stiffness)),
      loads_(*element_),
      laws_(element_->points(), law) {
  parameters.global_operator = GlobalOperator::tangent;
  parameters.tolerance = 1e-10;
  parameters.displacement_tolerance = 1e-9;
  parameters.max_iterations = 40;
}

void Problem::expect_small_strain() {
  parameters.tolerance = 1e-7;
  parameters.displacement_tolerance = 1e-5;
}

std::vector<int> Problem::all_nodes() const {
  std::vector<int> nodes(mesh_.nodes.size());
  std::iota(nodes.begin(), nodes.end(), 0);
  return nodes;
}

void Problem::set_law(int element, const AnalyticLaw& law) {
  for (int q = 0; q < kPointsPerElement; ++q) laws_[kPointsPerElement * element + q] = law;
}

void Problem::fix_u(const std::vector<int>& nodes, int i, const std::function<double(const Point2&)>& value) {
  for (const int node : nodes) {
    loads_.prescribe(2 * node + i, [v = value(mesh_.nodes[node])](double t) { return v * t; });
  }
}

void Problem::fix_u(const std::vector<int>& nodes, int i, double value) {
  fix_u(nodes, i, [value](const Point2&) { return value; });
}

void Problem::fix_v(const std::vector<int>& nodes, int c, const std::function<double(const Point2&)>& value) {
  for (const int node : nodes) {
    const int dof = element_->gradient_dof(node, c);
    if (dof >= 0) loads_.prescribe(dof, [v = value(mesh_.nodes[node])](double t) { return v * t; });
  }
}

void Problem::fix_v(const std::vector<int>& nodes, int c, double value) {
  fix_v(nodes, c, [value](const Point2&) { return value; });
}

NonlinearSolver& Problem::start() {
  points_ = std::make_unique<AnalyticPoints>(laws_);
  solver_ = std::make_unique<NonlinearSolver>(*element_, *points_, loads_, parameters);
  return *solver_;
}

void Problem::require_converged(const StepResult& result, int step) {
  if (result.converged) return;
  const Iteration& last = result.table.back();
  throw std::runtime_error(fmt::format("step {}: {}; at the end residual {:.1e}, correction {:.1e}, gap {:.1e}",
                                       step + 1, result.reason, last.residual, last.correction, last.gap));
}

const Equilibrium& Problem::solve(int steps) {
  start();
  for (int step = 0; step < steps; ++step) {
    const StepResult result = solver_->solve_step(1.0 / steps);
    require_converged(result, step);
  }
  return solver_->committed();
}

double Problem::reaction(const std::vector<int>& nodes, int i) const {
  double sum = 0;
  for (const int node : nodes) sum += solver_->committed().internal[2 * node + i];
  return sum;
}

int Problem::node_at(const Point2& X) const {
  int nearest = 0;
  for (int n = 1; n < static_cast<int>(mesh_.nodes.size()); ++n) {
    if ((mesh_.nodes[n] - X).norm() < (mesh_.nodes[nearest] - X).norm()) nearest = n;
  }
  return nearest;
}

}  // namespace femxdem
