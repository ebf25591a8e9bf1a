// Augmented Lagrangian against the saddle form: condition numbers and contraction of the multiplier's update.
#include <fmt/format.h>

#include <Eigen/Eigenvalues>

#include "problem.hpp"
#include "saddle.hpp"
#include "verification.hpp"

namespace femxdem {
namespace {

constexpr double kC1111 = 1200;

double condition(const SparseMatrix& K) {
  const Eigen::VectorXd values =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Eigen::MatrixXd(K), Eigen::EigenvaluesOnly).eigenvalues();
  return values.cwiseAbs().maxCoeff() / values.cwiseAbs().minCoeff();
}

/// Gap after each iteration of one elastic step of a shear layer (20 elements) with the penalty r / C1111.
std::vector<double> gaps(double penalty) {
  Problem problem(rectangle_mesh(0.05, 1, 1, 20), ElasticLaw{1000, 0.25, 0}, one_parameter_law(4));
  problem.parameters.penalty = penalty;
  problem.parameters.tolerance = 1e-30;
  problem.parameters.max_iterations = 6;
  const auto bottom = edge_nodes(problem.mesh(), "bottom"), top = edge_nodes(problem.mesh(), "top");
  problem.fix_u(problem.all_nodes(), 1);
  for (const int c : {0, 2, 3}) problem.fix_v(problem.all_nodes(), c);
  problem.fix_u(bottom, 0);
  problem.fix_u(top, 0, 1e-6);
  problem.fix_v(bottom, 1);
  problem.fix_v(top, 1);
  std::vector<double> gaps;
  for (const Iteration& i : problem.start().solve_step(1).table) gaps.push_back(i.gap);
  return gaps;
}

}  // namespace

Verification verify_multiplier() {
  Verification v;
  const MixedProblem problem(6, 12, 12);
  for (const double r : {1.0, 10.0, 100.0, 1000.0}) {
    v.add(fmt::format("condition number, augmented, r = {:g} C1111, at most", r),
          condition(problem.augmented(r * kC1111)), 0, 1e5 * r);
  }
  v.add("condition number, saddle form, lambda in C1111, at most", condition(problem.saddle(kC1111)), 0, 1e7);
  Figure figure{"constraint over the iterations, shear layer", "iteration", "gap / micro gradient", true, {}};
  for (const double r : {1.0, 10.0, 100.0, 1000.0}) {
    const std::vector<double> g = gaps(r);
    Curve curve{fmt::format("r = {:g} C1111", r), {}, {}, false};
    for (std::size_t i = 0; i < g.size(); ++i) {
      curve.x.push_back(static_cast<double>(i + 1));
      curve.y.push_back(g[i]);
    }
    v.add(fmt::format("contraction of the gap per iteration, r = {:g} C1111, at most", r), g[1] / g[0], 0, 1 / r);
    figure.curves.push_back(curve);
  }
  v.figures = {figure};
  return v;
}

}  // namespace femxdem
