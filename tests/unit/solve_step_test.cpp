#include <gtest/gtest.h>

#include <cmath>

#include "analytic_points.hpp"
#include "elastic_problem.hpp"
#include "nonlinear_solver.hpp"
#include "plane_strain_q8.hpp"
#include "second_gradient_q8.hpp"

namespace femxdem {
namespace {

const JaumannLaw kJaumann{1000, 0.25, 0};

SolverParameters newton() {
  SolverParameters p;
  p.global_operator = GlobalOperator::tangent;
  p.tolerance = 1e-9;
  p.displacement_tolerance = 1e-8;
  p.max_iterations = 30;
  p.penalty = 100;
  return p;
}

/// A mesh on a law in closed form, its lower edge fixed and its upper edge moved down by `shortening` at time 1.
struct Block {
  Block(const Mesh& m, const AnalyticLaw& law, double shortening, bool clamped, double D = 0)
      : mesh(m),
        element(D > 0 ? std::unique_ptr<Formulation>(std::make_unique<SecondGradientQ8>(mesh, one_parameter_law(D)))
                      : std::unique_ptr<Formulation>(std::make_unique<PlaneStrainQ8>(mesh))),
        points(std::vector<AnalyticLaw>(element->points(), law)),
        loads(*element) {
    for (const char* edge : {"bottom", "top"}) {
      const bool top = std::string(edge) == "top";
      for (const int node : edge_nodes(mesh, edge)) {
        if (clamped) loads.prescribe(2 * node, [](double) { return 0; });
        loads.prescribe(2 * node + 1, [=](double t) { return top ? -shortening * t : 0; });
      }
    }
    loads.prescribe(2 * edge_nodes(mesh, "bottom").front(), [](double) { return 0; });
  }
  /// Sum of the nodal forces on the upper edge [N/m].
  double force(const NonlinearSolver& solver) const {
    double sum = 0;
    for (const int node : edge_nodes(mesh, "top")) sum -= solver.committed().internal[2 * node + 1];
    return sum;
  }

  Mesh mesh;
  std::unique_ptr<Formulation> element;
  AnalyticPoints points;
  Loads loads;
};

Mesh block_mesh() {
  Mesh mesh = rectangle_mesh(1, 2, 3, 6);
  distort(mesh, 0.2, 5);
  return mesh;
}

TEST(SolveStep, UniformStrainIsExactAtFiniteStrainOnADistortedMesh) {
  for (const double D : {0.0, 20.0}) {
    Block block(block_mesh(), kJaumann, 0.5, false, D);
    NonlinearSolver solver(*block.element, block.points, block.loads, newton());
    for (int i = 0; i < 5; ++i) ASSERT_TRUE(solver.solve_step(0.2).converged);
    const Tensor2& F = solver.committed().F.front();
    EXPECT_NEAR(F(1, 1), 0.75, 1e-8);
    EXPECT_NEAR(F(0, 1), 0, 1e-8);
    for (const Tensor2& other : solver.committed().F) EXPECT_LT((other - F).norm(), 1e-8);
    EXPECT_NEAR(solver.committed().responses.front().stress(0, 0), 0, 1e-5);
  }
}

TEST(SolveStep, ForcesInBalanceAreNotBlamedForAMissedCriterion) {
  Block block(block_mesh(), kJaumann, 0.1, true);
  SolverParameters parameters = newton();
  parameters.displacement_tolerance = 0;
  NonlinearSolver solver(*block.element, block.points, block.loads, parameters);
  const StepResult result = solver.solve_step(1);
  EXPECT_FALSE(result.converged);
  EXPECT_NE(result.reason.find("the forces balance there"), std::string::npos) << result.reason;
}

/// |r_(k+1)| <= 5 |r_k|^2 down to round-off, in one step to 30 %, with a penalty of 100 C1111.
TEST(SolveStep, NewtonIsQuadraticAtThirtyPercent) {
  for (const double D : {0.0, 20.0}) {
    Block block(block_mesh(), kJaumann, 0.6, true, D);
    SolverParameters p = newton();
    p.tolerance = 1e-11;
    NonlinearSolver solver(*block.element, block.points, block.loads, p);
    const StepResult result = solver.solve_step(1);
    ASSERT_TRUE(result.converged) << result.reason;
    EXPECT_LE(result.iterations(), 6);
    for (std::size_t k = 2; k < result.table.size(); ++k) {
      EXPECT_LT(result.table[k].residual, 5 * std::pow(result.table[k - 1].residual, 2) + 1e-12) << "D = " << D;
    }
    double largest = 0;
    for (const Tensor2& F : solver.committed().F) largest = std::max(largest, 1 - F(1, 1));
    EXPECT_GT(largest, 0.3);
  }
}

TEST(SolveStep, ElasticOperatorFindsTheSameEquilibrium) {
  double force[2];
  Eigen::VectorXd x[2];
  for (const bool elastic : {false, true}) {
    Block block(block_mesh(), kJaumann, 0.1, true, 20);
    SolverParameters p = newton();
    if (elastic) p.global_operator = GlobalOperator::elastic;
    NonlinearSolver solver(*block.element, block.points, block.loads, p);
    for (int i = 0; i < 2; ++i) ASSERT_TRUE(solver.solve_step(0.5).converged);
    force[elastic] = block.force(solver);
    x[elastic] = solver.committed().x;
  }
  EXPECT_NEAR(force[1], force[0], 1e-7 * force[0]);
  EXPECT_LT((x[1] - x[0]).norm(), 1e-7 * x[0].norm());
}

TEST(SolveStep, RejectedStepLeavesNoTrace) {
  Block tried(block_mesh(), FailingLaw{1000, 0.25, 0.12}, 0.4, false), straight(block_mesh(), kJaumann, 0.4, false);
  straight.points = AnalyticPoints(std::vector<AnalyticLaw>(straight.element->points(), FailingLaw{1000, 0.25, 0.12}));
  NonlinearSolver one(*tried.element, tried.points, tried.loads, newton());
  NonlinearSolver two(*straight.element, straight.points, straight.loads, newton());
  const StepResult rejected = one.solve_step(1);  // 20 %
  EXPECT_FALSE(rejected.converged);
  ASSERT_TRUE(rejected.failure.has_value());
  EXPECT_NE(rejected.reason.find("strain"), std::string::npos);
  EXPECT_EQ(one.committed().time, 0);
  for (int i = 0; i < 2; ++i) {
    EXPECT_TRUE(one.solve_step(0.25).converged);
    EXPECT_TRUE(two.solve_step(0.25).converged);
  }
  EXPECT_EQ(one.committed().x, two.committed().x);
  EXPECT_EQ(one.committed().internal, two.committed().internal);
}

TEST(SolveStep, TooFewIterationsAreSaidSo) {
  Block block(block_mesh(), kJaumann, 0.6, true);
  SolverParameters p = newton();
  p.max_iterations = 1;
  NonlinearSolver solver(*block.element, block.points, block.loads, p);
  const StepResult result = solver.solve_step(1);
  EXPECT_FALSE(result.converged);
  EXPECT_FALSE(result.reason.empty());
  EXPECT_EQ(solver.committed().time, 0);
}

TEST(SolveStep, RestartGivesTheSameBits) {
  Block first(block_mesh(), kJaumann, 0.2, true, 20), second(block_mesh(), kJaumann, 0.2, true, 20);
  SolverParameters p = newton();
  p.global_operator = GlobalOperator::quasi_newton;
  p.tolerance = 1e-6;
  NonlinearSolver one(*first.element, first.points, first.loads, p);
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(one.solve_step(0.25).converged);
  NamedArrays arrays;
  one.save(arrays);
  NonlinearSolver two(*second.element, second.points, second.loads, p);
  second.points.load(first.points.save());
  two.load(arrays);
  EXPECT_EQ(two.committed().x, one.committed().x);
  ASSERT_TRUE(one.solve_step(0.25).converged);
  ASSERT_TRUE(two.solve_step(0.25).converged);
  EXPECT_EQ(two.committed().x, one.committed().x);
  EXPECT_EQ(two.committed().internal, one.committed().internal);
}

}  // namespace
}  // namespace femxdem
