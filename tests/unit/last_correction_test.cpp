#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <optional>

#include "assembler.hpp"
#include "convergence.hpp"
#include "mean_points.hpp"
#include "softening_problem.hpp"

namespace femxdem {
namespace {

constexpr double kTolerance = 1e-3;
constexpr int kSteps = 16;  // the peak is at the 9th
constexpr double kThetas[] = {1, 0.5};

/// The softening biaxial test, second gradient, on points that answer with the mean over their trials (theta < 1) or
/// with the end.
struct Ending {
  Ending(LastCorrection last, double theta, double tolerance = kTolerance, double noise = 0) {
    SolverParameters parameters = solver_parameters(GlobalOperator::quasi_newton, tolerance, 30);
    problem = softening_biaxial(4, 2e3, parameters);
    parameters.last_correction = last;
    parameters.answer_at = theta;
    if (noise > 0) parameters.qn_first = 0.5, parameters.qn_scatter = 0.1;  // as of volume elements
    points.emplace(softening_laws(*problem.element, kHardening), theta, noise);
    problem.solver = std::make_unique<NonlinearSolver>(*problem.element, *points, *problem.loads, parameters);
  }
  NonlinearSolver& solver() { return *problem.solver; }
  StepResult step() {
    const StepResult result = solver().solve_step(1);
    EXPECT_TRUE(result.converged) << result.reason;
    evaluations += result.evaluations;
    learned += result.learned_at_end;
    return result;
  }

  static constexpr double kHardening = -5e5;
  SofteningProblem problem;
  std::optional<MeanPoints> points;
  int evaluations = 0, learned = 0;
};

/// Force of the top after every step, and what it took.
struct Curve {
  std::vector<double> force;
  int evaluations = 0, learned = 0;

  /// Mean distance from another, over it.
  double off(const std::vector<double>& other) const {
    double sum = 0;
    for (std::size_t i = 0; i < force.size(); ++i) sum += std::abs(force[i] / other[i] - 1);
    return sum / static_cast<double>(force.size());
  }
};

Curve curve(LastCorrection last, double theta, double tolerance, double noise = 0) {
  Ending run(last, theta, tolerance, noise);
  Curve curve;
  for (int i = 0; i < kSteps; ++i) {
    run.step();
    curve.force.push_back(run.problem.reaction("top", 1));
  }
  curve.evaluations = run.evaluations;
  curve.learned = run.learned;
  return curve;
}

/// Forces at a fiftieth of the tolerances below.
const std::vector<double>& exact_force(double theta) {
  static std::map<double, std::vector<double>> known;
  auto [found, is_new] = known.try_emplace(theta);
  if (is_new) found->second = curve(LastCorrection::evaluated, theta, kTolerance / 50).force;
  return found->second;
}

TEST(LastCorrection, SparesEvaluationsAndKeepsTheCurve) {
  for (const double theta : kThetas) {
    const std::vector<double>& exact = exact_force(theta);
    const Curve evaluated = curve(LastCorrection::evaluated, theta, kTolerance);
    const Curve learned = curve(LastCorrection::learned, theta, kTolerance);
    EXPECT_EQ(evaluated.learned, 0);
    EXPECT_GE(learned.learned, 3) << theta;
    EXPECT_LT(learned.evaluations, evaluated.evaluations) << theta;
    EXPECT_LT(evaluated.off(exact), 2 * kTolerance) << theta;
    EXPECT_LT(learned.off(exact), 2 * kTolerance) << theta;
  }
}

/// Stresses that jump by `noise` of themselves from one F to any other, as those of volume elements do: the residual
/// has a floor of about 5.7 times that.
TEST(LastCorrection, NoisyAnswersNeedNoMoreEvaluationsThanWithoutIt) {
  constexpr double kCoarse = 5e-3;
  for (const double theta : kThetas) {
    const std::vector<double>& exact = exact_force(theta);
    for (const double noise : {2e-4, 4e-4}) {
      const Curve evaluated = curve(LastCorrection::evaluated, theta, kCoarse, noise);
      const Curve learned = curve(LastCorrection::learned, theta, kCoarse, noise);
      EXPECT_GT(learned.learned, 0);
      EXPECT_LT(learned.evaluations, evaluated.evaluations) << theta << ", " << noise;
      EXPECT_LT(learned.off(exact), kCoarse) << theta << ", " << noise;
      EXPECT_LT(evaluated.off(exact), kCoarse) << theta << ", " << noise;
    }
  }
}

/// Where the mesh is at the end, points that have gone there from their own states balance as well as was expected.
TEST(LastCorrection, ForcesBalanceWhereTheMeshIs) {
  Ending on(LastCorrection::learned, 1);
  const Assembler assembler(*on.problem.element, on.problem.loads->prescribed_dofs());
  for (int i = 0; i < kSteps; ++i) {
    MeanPoints before = *on.points;
    const StepResult result = on.step();
    EXPECT_LE(result.table.back().residual, kTolerance);
    Equilibrium state = on.solver().committed();
    std::vector<Tensor2> stress;
    for (const Response& r : before.evaluate(state.F, Operator::none)) stress.push_back(r.stress);
    state.internal = assembler.force(state.configuration(), stress);
    EXPECT_LE(on.solver().relative_residual(state), kTolerance) << i;
  }
  EXPECT_GT(on.learned, 0);
}

/// States lag by the last correction of their step, whatever came before.
TEST(LastCorrection, StatesFollowAndNothingAccumulates) {
  for (const double theta : kThetas) {
    Ending on(LastCorrection::learned, theta);
    Eigen::VectorXd start = on.solver().committed().x;
    for (int i = 0; i < kSteps; ++i) {
      const StepResult result = on.step();
      const Equilibrium& now = on.solver().committed();
      const Eigen::VectorXd end = start + (now.x - start) / theta;
      const std::vector<Tensor2> F = on.problem.element->deformation(end);
      const std::vector<Tensor2> from = on.problem.element->deformation(start);
      double behind = 0, moved = 0;
      for (std::size_t p = 0; p < F.size(); ++p) {
        behind += (F[p] - on.points->committed(p).F).squaredNorm();
        moved += (F[p] - from[p]).squaredNorm();
      }
      const double limit = result.learned_at_end ? 0.3 : 1e-9;
      EXPECT_LE(std::sqrt(behind / moved), limit) << theta << ", " << i;
      EXPECT_EQ(behind > 1e-9 * moved, result.learned_at_end);
      start = end;
    }
  }
}

TEST(LastCorrection, ARestartHasTheSameBits) {
  for (const double theta : kThetas) {
    Ending whole(LastCorrection::learned, theta), first(LastCorrection::learned, theta),
        second(LastCorrection::learned, theta);
    int steps = 0;
    for (bool lags = false; !lags || steps < 6; ++steps) lags = first.step().learned_at_end;
    for (int i = 0; i < kSteps; ++i) whole.step();
    ASSERT_LT(steps, kSteps - 2);
    NamedArrays arrays;
    first.solver().save(arrays);
    second.points->set_committed(*first.points);
    second.solver().load(arrays);
    for (int i = steps; i < kSteps; ++i) second.step();
    EXPECT_EQ(second.solver().committed().x, whole.solver().committed().x) << theta;
    EXPECT_EQ(first.learned + second.learned, whole.learned);
  }
}

TEST(Contraction, IsTheRootMeanSquareOfWhatCorrectionsNearTheToleranceHaveLeft) {
  Contraction contraction(1e-3);
  EXPECT_FALSE(contraction.after(2e-3)) << "nothing seen";
  for (const double residual : {1e-1, 4e-3, 2e-3, 4e-4}) contraction.add(residual);  // 0.5 and 0.2; 0.04 from too far
  const double ratio = std::sqrt((0.5 * 0.5 + 0.2 * 0.2) / 2);
  ASSERT_TRUE(contraction.after(2e-3));
  EXPECT_NEAR(*contraction.after(2e-3), ratio * 2e-3, 1e-12);
  EXPECT_FALSE(contraction.after(4.1e-3)) << "larger than any it was learned from";
  for (int step = 0; step < 3; ++step) contraction.begin_step();
  ASSERT_TRUE(contraction.after(2e-3)) << "1.02 residuals are left";
  NamedArrays arrays;
  contraction.save(arrays);
  Contraction same(1e-3);
  same.load(arrays);
  EXPECT_EQ(*same.after(2e-3), *contraction.after(2e-3));
  contraction.begin_step();
  EXPECT_FALSE(contraction.after(2e-3)) << "too long ago";
}

}  // namespace
}  // namespace femxdem
