#include "solve_step.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "analytic_points.hpp"
#include "elastic_problem.hpp"
#include "second_gradient_q8.hpp"

namespace femxdem {
namespace {

constexpr double kC1111 = 1200;  // E = 1000, nu = 0.25
const JaumannLaw kJaumann{1000, 0.25, 0};
const DruckerPragerLaw kSoftening{.young = 1000,
                                  .poisson = 0.25,
                                  .cohesion = 2,
                                  .friction_angle = 0.5,
                                  .dilatancy_angle = 0.2,
                                  .hardening = -10,
                                  .residual_stress = 0.8,
                                  .initial_pressure = 1};

SolverParameters newton() {
  SolverParameters p;
  p.global_operator = GlobalOperator::tangent;
  p.tolerance = 1e-9;
  p.displacement_tolerance = 1e-8;
  p.max_iterations = 30;
  return p;
}

/// A mesh on a law in closed form, its lower edge fixed and its upper edge moved down by `shortening` at time 1.
struct Block {
  Block(const Mesh& m, const AnalyticLaw& law, double shortening, bool clamped, double D = 0, double penalty = 100)
      : mesh(m),
        element(D > 0 ? std::make_unique<SecondGradientQ8>(mesh, one_parameter_law(D), penalty * kC1111)
                      : std::make_unique<Element>(mesh)),
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
  void confine(double pressure) {
    for (const char* edge : {"left", "right"}) {
      loads.add({.edge = edge,
                 .point = {},
                 .kind = LoadKind::pressure,
                 .component = Component::none,
                 .value = pressure,
                 .table = {}});
    }
  }
  /// Sum of the nodal forces on the upper edge [N/m].
  double force(const NonlinearSolver& solver) const {
    double sum = 0;
    for (const int node : edge_nodes(mesh, "top")) sum -= solver.committed().internal[2 * node + 1];
    return sum;
  }

  Mesh mesh;
  std::unique_ptr<Element> element;
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

/// |r_(k+1)| <= c |r_k|^2 down to round-off, in one step to 30 %.
TEST(SolveStep, NewtonIsQuadraticAtThirtyPercent) {
  for (const double D : {0.0, 20.0}) {
    Block block(block_mesh(), kJaumann, 0.6, true, D, 1e5);
    SolverParameters p = newton();
    p.tolerance = 1e-11;
    NonlinearSolver solver(*block.element, block.points, block.loads, p);
    const StepResult result = solver.solve_step(1);
    ASSERT_TRUE(result.converged) << result.reason;
    for (const Iteration& i : result.table)
      printf("D %g: residual %.2e correction %.2e gap %.2e\n", D, i.residual, i.correction, i.gap);
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

/// Biaxial compression past the peak: the learned tangents find what Newton's do, without a tangent of the law.
TEST(SolveStep, LearnedTangentsFollowSoftening) {
  std::vector<double> curve[2];
  for (const bool learned : {false, true}) {
    Mesh mesh = rectangle_mesh(1, 2, 2, 4);
    Block block(mesh, kSoftening, 0.04, false, 2);
    block.confine(1);
    SolverParameters p = newton();
    p.tolerance = 1e-6;
    p.displacement_tolerance = 1e-4;
    if (learned) p.global_operator = GlobalOperator::quasi_newton;
    NonlinearSolver solver(*block.element, block.points, block.loads, p);
    for (int i = 0; i < 20; ++i) {
      const StepResult result = solver.solve_step(0.05);
      ASSERT_TRUE(result.converged) << result.reason << " in step " << i;
      curve[learned].push_back(block.force(solver));
    }
  }
  const double peak = *std::max_element(curve[0].begin(), curve[0].end());
  EXPECT_LT(curve[0].back(), 0.95 * peak);
  for (int i = 0; i < 20; ++i) EXPECT_NEAR(curve[1][i], curve[0][i], 1e-4 * peak);
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
