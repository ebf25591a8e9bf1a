#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "analytic_points.hpp"
#include "loads.hpp"
#include "nonlinear_solver.hpp"
#include "second_gradient_q8.hpp"

namespace femxdem {

/// The closed forms are those of small strain: they are compared in the limit of displacements scaled by this.
inline constexpr double kSmall = 1e-6;

/// Elasticity of the closed forms, lambda = G = 400.
inline const ElasticLaw kElastic{1000, 0.25, 0};
inline constexpr double kG = 400, kLambda = 400;

/// A boundary value problem with laws in closed form, put together by hand: u and v prescribed node by node, in
/// proportion to the time, which goes from 0 to 1.
class Problem {
 public:
  /// double_stiffness: law of the second gradient [N]; none: Q8 of the first gradient.
  Problem(Mesh mesh, const AnalyticLaw& law, const std::optional<DoubleStiffness>& double_stiffness = std::nullopt);

  const Mesh& mesh() const { return mesh_; }
  Formulation& element() { return *element_; }
  const SecondGradientQ8& second_gradient() const { return dynamic_cast<const SecondGradientQ8&>(*element_); }
  Loads& loads() { return loads_; }
  std::vector<int> all_nodes() const;
  /// Tolerances for strains of 1e-8 to 1e-6, of which F = I + grad u keeps no more than 8 digits.
  void expect_small_strain();
  /// Another law in one element.
  void set_law(int element, const AnalyticLaw& law);
  /// Prescribes u_i at nodes to value(X) at time 1 [m].
  void fix_u(const std::vector<int>& nodes, int i, const std::function<double(const Point2&)>& value);
  void fix_u(const std::vector<int>& nodes, int i, double value = 0);
  /// Prescribes v_c (c = 2 i + j) at the corners among nodes.
  void fix_v(const std::vector<int>& nodes, int c, const std::function<double(const Point2&)>& value);
  void fix_v(const std::vector<int>& nodes, int c, double value = 0);

  /// Solves in equal steps to time 1; throws std::runtime_error when a step does not converge.
  const Equilibrium& solve(int steps = 1);
  /// Throws std::runtime_error with what the last iteration found when a step has not converged.
  static void require_converged(const StepResult& result, int step);
  /// Starts the solver without a step; `solver` may then be used step by step.
  NonlinearSolver& start();
  SolverParameters parameters;

  double u(int node, int i) const { return solver_->committed().x[2 * node + i]; }
  /// Sum of the nodal forces on nodes in direction i [N/m].
  double reaction(const std::vector<int>& nodes, int i) const;
  /// Node nearest to a point.
  int node_at(const Point2& X) const;

 private:
  Mesh mesh_;
  std::unique_ptr<Formulation> element_;
  Loads loads_;
  std::vector<AnalyticLaw> laws_;
  std::unique_ptr<AnalyticPoints> points_;
  std::unique_ptr<NonlinearSolver> solver_;
};

}  // namespace femxdem
