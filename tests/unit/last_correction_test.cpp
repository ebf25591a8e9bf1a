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
  Ending(LastCorrection last, double theta, double tolerance = kTolerance, double noise = 0,
         double over_noise = SolverParameters{}.tolerance_over_noise) {
    SolverParameters parameters = solver_parameters(GlobalOperator::quasi_newton, tolerance, 30);
    problem = softening_biaxial(4, 2e3, parameters);
    parameters.last_correction = last;
    parameters.answer_at = theta;
    parameters.tolerance_over_noise = over_noise;
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

/// Noise that keeps the residual above the tolerance: no number of iterations is enough otherwise.
TEST(LastCorrection, TheToleranceFollowsNoiseThatReachesIt) {
  constexpr double kFine = 2e-3, kNoise = 4e-4;
  constexpr int kBeforePeak = 8;
  for (const double theta : kThetas) {
    Ending following(LastCorrection::learned, theta, kFine, kNoise),
        waiting(LastCorrection::learned, theta, kFine, kNoise, 0);
    EXPECT_FALSE(waiting.solver().solve_step(1).converged) << theta;
    for (int i = 0; i < kBeforePeak; ++i) {
      const StepResult result = following.step();
      EXPECT_LE(result.table.back().residual, result.tolerance);
      EXPECT_LE(result.tolerance, Contraction::kMostRaised * kFine);
      EXPECT_NEAR(following.problem.reaction("top", 1) / exact_force(theta).at(static_cast<std::size_t>(i)), 1, kFine);
    }
    EXPECT_LE(following.evaluations, 3 * kBeforePeak) << theta;
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

/// Residuals of steps that start from each of `first`, three of them, r_{k+1}^2 = a^2 r_k^2 + noise^2.
void add_steps(Contraction& contraction, std::initializer_list<double> first, double a, double noise) {
  for (double residual : first) {
    contraction.begin_step();
    for (int i = 0; i < 3; ++i) {
      contraction.add(residual);
      residual = std::hypot(a * residual, noise);
    }
  }
}

TEST(Contraction, TellsWhatCorrectionsLeaveFromNoise) {
  constexpr double kGiven = 5e-3, kLeft = 0.3, kNoise = 6e-3;
  Contraction contraction(kGiven, 1.5), most(kGiven, 5), never(kGiven, 0);
  EXPECT_FALSE(contraction.after(7e-3)) << "nothing seen";
  EXPECT_EQ(contraction.noise(), 0);
  EXPECT_EQ(contraction.tolerance(), kGiven);
  for (Contraction* each : {&contraction, &most, &never}) {
    add_steps(*each, {1.9e-2, 1.5e-2, 8e-3}, kLeft, kNoise);
    EXPECT_NEAR(each->noise(), kNoise, 1e-9);
    ASSERT_TRUE(each->after(1e-2));
    EXPECT_NEAR(*each->after(1e-2), std::hypot(kLeft * 1e-2, kNoise), 1e-9);
  }
  EXPECT_FALSE(contraction.after(2.1e-2)) << "larger than any it was learned from";
  EXPECT_NEAR(contraction.tolerance(), 1.5 * kNoise, 1e-9);
  EXPECT_EQ(most.tolerance(), 2 * kGiven);
  EXPECT_EQ(never.tolerance(), kGiven);
  NamedArrays arrays;
  contraction.save(arrays);
  Contraction same(kGiven, 1.5);
  same.load(arrays);
  EXPECT_EQ(same.tolerance(), contraction.tolerance());
  EXPECT_EQ(*same.after(1e-2), *contraction.after(1e-2));
}

TEST(Contraction, HasNoNoiseWhereResidualsFallOrLittleWasSeen) {
  Contraction one(1e-3, 1.5), steady(1e-3, 1.5), faster(1e-3, 1.5);
  for (const double residual : {1e-1, 4e-3, 2e-3}) one.add(residual);  // 0.5; 0.04 from too far
  ASSERT_TRUE(one.after(1e-3));
  EXPECT_NEAR(*one.after(1e-3), 5e-4, 1e-12);
  add_steps(steady, {4e-3, 3e-3}, 0.4, 0);
  EXPECT_NEAR(*steady.after(2e-3), 8e-4, 1e-9);
  for (const double residual : {4e-3, 2e-3, 1e-4}) faster.add(residual);  // the smaller the better
  for (const Contraction* each : {&one, &steady, &faster}) EXPECT_LT(each->noise(), 1e-8);
}

TEST(Contraction, IsForgottenStepByStepAndWhereResidualsGrow) {
  Contraction contraction(1e-3, 1.5);
  add_steps(contraction, {2e-3, 3e-3}, 0.5, 0);  // 0.8 x 2 + 2 pairs
  for (int step = 0; step < 5; ++step) contraction.begin_step();
  EXPECT_TRUE(contraction.after(2e-3)) << "1.18 pairs are left";
  contraction.begin_step();
  EXPECT_FALSE(contraction.after(2e-3)) << "too long ago";
  add_steps(contraction, {2e-3, 3e-3}, 0.5, 0);
  contraction.add(1.4e-3);  // of 0.75e-3
  EXPECT_FALSE(contraction.after(1.4e-3));
}

}  // namespace
}  // namespace femxdem
