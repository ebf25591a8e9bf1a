#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <optional>

#include "elastic_problem.hpp"
#include "loads.hpp"
#include "mean_points.hpp"
#include "mid_step_points.hpp"
#include "nonlinear_solver.hpp"
#include "path_driver.hpp"
#include "plane_strain_q8.hpp"

namespace femxdem {
namespace {

SolverParameters tight(double theta) {
  SolverParameters p;
  p.tolerance = 1e-9;
  p.displacement_tolerance = 1e-6;
  p.max_iterations = 60;
  p.answer_at = theta;
  return p;
}

/// Simple shear to gamma = 1 of a Jaumann law: sigma_xy = G sin gamma. Largest distance of the rows from it, over G, as
/// they are told (theta) or, naively, as if their stress were that of the end.
double shear_error(int increments, double theta, bool naive) {
  const double G = 400;
  MeanPoints point({JaumannLaw{1000, 0.25, 0}}, theta);
  PathDriver driver(point, tight(naive ? 1 : theta));
  PathSegment segment;
  segment.deformation_gradient = {1, 1, 0, 0, 1, 0, 0, 0, 1};
  segment.increments = increments;
  driver.begin_segment(segment);
  double error = 0;
  for (int i = 1; i <= increments; ++i) {
    EXPECT_TRUE(driver.solve(static_cast<double>(i) / increments).converged);
    driver.commit();
    const double gamma = driver.F()(0, 1);
    EXPECT_NEAR(gamma, (i - 1 + (naive ? 1 : theta)) / increments, 1e-12);
    error = std::max(error, std::abs(driver.response().stress(0, 1) - G * std::sin(gamma)) / G);
  }
  return error;
}

TEST(MidStep, ShearCurveIsOfSecondOrderAndTheNaiveOneOfFirst) {
  for (const double theta : {0.5, 0.6, 2.0 / 3}) {
    EXPECT_NEAR(shear_error(10, theta, false) / shear_error(20, theta, false), 4, 0.5) << theta;
    EXPECT_NEAR(shear_error(20, theta, false) / shear_error(40, theta, false), 4, 0.5) << theta;
    EXPECT_LT(shear_error(40, theta, false), 1e-3);
  }
  EXPECT_NEAR(shear_error(20, 0.5, true) / shear_error(40, 0.5, true), 2, 0.2);
  EXPECT_GT(shear_error(40, 0.5, true), 1e-2);
}

/// A block under a follower pressure on its sides that grows with time, its top moved down; a Jaumann law.
struct Block {
  Block(const AnalyticLaw& law, double theta, double shortening, std::vector<std::array<double, 2>> pressure)
      : mesh(rectangle_mesh(1, 2, 2, 2)),
        element(mesh),
        points(std::vector<AnalyticLaw>(element.points(), law), theta),
        loads(element) {
    for (const int node : edge_nodes(mesh, "bottom")) loads.prescribe(2 * node + 1, [](double) { return 0.0; });
    loads.prescribe(2 * edge_nodes(mesh, "bottom").front(), [](double) { return 0.0; });
    Load top;
    top.edge = "top";
    top.kind = LoadKind::displacement;
    top.component = Component::y;
    top.value = -shortening;
    if (shortening > 0) loads.add(top);
    for (const char* edge : {"left", "right"}) {
      Load load;
      load.edge = edge;
      load.kind = LoadKind::pressure;
      load.value = 1;
      load.table = pressure;
      loads.add(load);
    }
    solver.emplace(element, points, loads, tight(theta));
  }
  double force() const {
    double sum = 0;
    for (const int node : edge_nodes(mesh, "top")) sum -= solver->committed().internal[2 * node + 1];
    return sum;
  }

  Mesh mesh;
  PlaneStrainQ8 element;
  MeanPoints points;
  Loads loads;
  std::optional<NonlinearSolver> solver;
};

const JaumannLaw kLaw{1000, 0.25, 0};
const std::vector<std::array<double, 2>> kPressure = {{0, 0}, {1, 30}};

/// Top force at the end of each of 320 steps whose answers are those of their ends, times 960.
std::map<long, double> reference() {
  std::map<long, double> force;
  Block block(kLaw, 1, 0.2, kPressure);
  const int n = 320;
  for (int i = 0; i < n; ++i) {
    EXPECT_TRUE(block.solver->solve_step(1.0 / n).converged);
    force[std::lround(block.solver->committed().time * 3 * n)] = block.force();
  }
  return force;
}

/// Largest error of the top force after the first step.
double block_error(int n, double theta, double alternate) {
  static const std::map<long, double> exact = reference();
  Block block(kLaw, theta, 0.2, kPressure);
  double error = 0;
  for (int i = 0; i < n; ++i) {
    const double dt = (i % 2 == 0 ? 2 - alternate : alternate) / n;
    EXPECT_TRUE(block.solver->solve_step(dt).converged);
    const double at = block.solver->committed().time * 3 * 320;
    const auto above = exact.upper_bound(static_cast<long>(std::floor(at)));
    if (above == exact.begin() || above == exact.end()) continue;
    const auto below = std::prev(above);
    const double share = (at - static_cast<double>(below->first)) / static_cast<double>(above->first - below->first);
    const double force = below->second + share * (above->second - below->second);
    error = std::max(error, std::abs(block.force() - force));
  }
  return error / exact.rbegin()->second;
}

TEST(MidStep, FollowerLoadsAndPrescribedValuesAreOfSecondOrder) {
  for (const double theta : {0.5, 2.0 / 3}) {
    EXPECT_GT(block_error(10, theta, 1) / block_error(20, theta, 1), 3.4) << theta;
    EXPECT_LT(block_error(20, theta, 1), 5e-4) << theta;
  }
}

TEST(MidStep, StepsOfVeryDifferentSizeStayOfSecondOrder) {
  for (const double theta : {0.5, 2.0 / 3}) {
    EXPECT_GT(block_error(10, theta, 0.05) / block_error(20, theta, 0.05), 3.0) << theta;
    EXPECT_LT(block_error(20, theta, 0.05), 2e-3) << theta;
  }
}

/// Loads that are not balanced at the start, on an elastic block: half way, 1 - theta of what the start lacked is left,
/// at the end nothing. (Balance at theta would overshoot at the end by (1 - theta) / theta of it, to the other side,
/// and again in every step.)
TEST(MidStep, AnImbalanceOfTheStartIsGoneAtTheEnd) {
  for (const double theta : {0.5, 0.6, 2.0 / 3}) {
    Block block(ElasticLaw{1000, 0.25, 0}, theta, 0, {{0, 1}, {100, 2}});
    const Tensor2 I = Tensor2::Identity();
    for (int i = 0; i < 3; ++i) {
      ASSERT_TRUE(block.solver->solve_step(1).converged);
      const Equilibrium& now = block.solver->committed();
      const double strain = (block.points.committed(0).F - I)(0, 0) / (1 + (i + 1) / 100.0);  // of a unit pressure
      const double half_way = (now.F[0] - I)(0, 0);
      EXPECT_NEAR(half_way / strain, 1 + now.time / 100 - (i == 0 ? 1 - theta : 0), i == 0 ? 0.02 : 1e-4) << theta;
      EXPECT_LT(block.solver->relative_residual(now), 1e-8);
    }
  }
}

/// Way down and back, the turn at the end of a step: the next step starts from the turn, elastic, and knows nothing of
/// the mean before it.
TEST(MidStep, ReversalOfPlasticity) {
  const VonMisesLaw law{1000, 0.25, 6, 100, 0, 0};
  MeanPoints point({law}, 0.5);
  PathDriver driver(point, tight(0.5));
  PathSegment segment;
  segment.increments = 50;
  for (int c = 0; c < 6; ++c) segment.stress[c] = 0;
  segment.stress[1] = kNotGiven;
  segment.strain[1] = 0.05;
  driver.begin_segment(segment);
  for (int i = 1; i <= 50; ++i) {
    ASSERT_TRUE(driver.solve(i / 50.0).converged);
    driver.commit();
  }
  const double H = 100, E = 1000, Y = 6;
  EXPECT_NEAR(path_strain(driver.F())[1], 0.0495, 1e-6);
  EXPECT_NEAR(driver.response().stress(1, 1), (Y + H * 0.0495) / (1 + H / E), 1e-4);
  segment.strain[1] = 0.045;
  driver.begin_segment(segment);
  const double turn = (Y + H * 0.05) / (1 + H / E);
  EXPECT_NEAR(driver.response().stress(1, 1), turn, 1e-3);
  for (int i = 1; i <= 5; ++i) {
    ASSERT_TRUE(driver.solve(i / 5.0).converged);
    driver.commit();
    EXPECT_NEAR(driver.response().stress(1, 1), turn - E * (0.05 - path_strain(driver.F())[1]), 1e-3);
  }
}

TEST(MidStep, GoesOnFromSavedArraysWithEqualBits) {
  Block whole(kLaw, 0.5, 0.2, kPressure), first(kLaw, 0.5, 0.2, kPressure), second(kLaw, 0.5, 0.2, kPressure);
  for (int i = 0; i < 6; ++i) ASSERT_TRUE(whole.solver->solve_step(0.1).converged);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(first.solver->solve_step(0.1).converged);
  NamedArrays arrays;
  first.solver->save(arrays);
  second.points.set_committed(first.points);
  second.solver->load(arrays);
  EXPECT_EQ(second.solver->time(), first.solver->time());
  for (int i = 3; i < 6; ++i) ASSERT_TRUE(second.solver->solve_step(0.1).converged);
  EXPECT_EQ(second.solver->committed().x, whole.solver->committed().x);
  EXPECT_EQ(second.solver->committed().internal, whole.solver->committed().internal);
  EXPECT_EQ(second.solver->time(), whole.solver->time());
}

}  // namespace
}  // namespace femxdem
