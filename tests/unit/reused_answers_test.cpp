#include "reused_answers.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "assembler.hpp"
#include "softening_problem.hpp"

namespace femxdem {
namespace {

/// Points that keep what they were asked for, step by step.
class Watched : public MaterialPoints {
 public:
  explicit Watched(MaterialPoints& points) : points_(points), state(points.size(), Tensor2::Identity()) {}

  std::size_t size() const override { return points_.size(); }
  void begin_step() override { asked.clear(); }
  std::vector<Response> evaluate(std::span<const Tensor2> F, Operator wanted) override {
    for (std::size_t p = 0; p < F.size(); ++p) evaluated += asked.empty() || F[p] != asked.back()[p];
    asked.emplace_back(F.begin(), F.end());
    return points_.evaluate(F, wanted);
  }
  void commit() override {
    points_.commit();
    before = state;
    state = asked.back();
  }
  void save_each(const TakeState& take) override { points_.save_each(take); }
  void load_each(const StateSource& states) override { points_.load_each(states); }

 private:
  MaterialPoints& points_;

 public:
  std::vector<std::vector<Tensor2>> asked;  ///< F of the trials of the step under way
  std::vector<Tensor2> state, before;       ///< F of the committed states, and one step earlier
  long evaluated = 0;                       ///< points whose F was another one than in the trial before
};

/// The softening biaxial test on watched points, first gradient.
struct Reusing {
  explicit Reusing(double below, double tolerance = 5e-3) {
    SolverParameters parameters = solver_parameters(GlobalOperator::quasi_newton, tolerance, 15);
    problem = softening_biaxial(4, 0, parameters);
    parameters.reuse_below = below;
    points = std::make_unique<Watched>(*problem.points);
    problem.solver = std::make_unique<NonlinearSolver>(*problem.element, *points, *problem.loads, parameters);
    points->evaluated = 0;
  }
  NonlinearSolver& solver() { return *problem.solver; }
  StepResult step() {
    const StepResult result = solver().solve_step(1);
    EXPECT_TRUE(result.converged) << result.reason;
    reused += result.reused;
    return result;
  }
  /// Residual of the committed displacements with what the points, as they were before the step, answer there.
  double true_residual(AnalyticPoints before) {
    Equilibrium state = solver().committed();
    std::vector<Tensor2> stress;
    for (const Response& r : before.evaluate(state.F, Operator::none)) stress.push_back(r.stress);
    const Assembler assembler(*problem.element, problem.loads->prescribed_dofs());
    state.internal = assembler.force(state.configuration(), stress);
    return solver().relative_residual(state);
  }

  SofteningProblem problem;
  std::unique_ptr<Watched> points;
  long reused = 0;
};

constexpr int kSteps = 14;  // the peak is at the 11th

TEST(ReusedAnswers, WithoutAnyTheSolutionIsTheSameToTheBit) {
  Reusing off(0), none(1e-300);
  for (int i = 0; i < kSteps; ++i) {
    off.step();
    none.step();
    EXPECT_EQ(off.solver().committed().x, none.solver().committed().x) << i;
  }
  EXPECT_EQ(off.reused + none.reused, 0);
}

TEST(ReusedAnswers, SparePointsAndLeaveTheForcesInBalance) {
  Reusing off(0), on(0.2);
  for (int i = 0; i < kSteps; ++i) {
    off.step();
    const AnalyticPoints before = *on.problem.points;
    const StepResult result = on.step();
    EXPECT_LE(result.table.back().residual, 5e-3) << "with its error, " << i;
    EXPECT_LE(on.true_residual(before), 5e-3) << i;
  }
  EXPECT_GT(on.reused, 0);
  EXPECT_LT(on.points->evaluated, off.points->evaluated);
  const double force = off.problem.reaction("top", 1);
  EXPECT_NEAR(on.problem.reaction("top", 1), force, 0.01 * std::abs(force));
}

/// A state ends where its last trial did, within `below` of the step, and starts from there.
TEST(ReusedAnswers, StatesFollowAndNothingAccumulates) {
  constexpr double kBelow = 0.3;
  Reusing on(kBelow);
  long behind = 0;
  for (int i = 0; i < kSteps; ++i) {
    on.step();
    for (std::size_t p = 0; p < on.points->size(); ++p) {
      const Tensor2 U = polar_decomposition(on.solver().committed().F[p]).U;
      const Tensor2 reached = polar_decomposition(on.points->state[p]).U;
      EXPECT_LE((U - reached).norm(), kBelow * (reached - polar_decomposition(on.points->before[p]).U).norm());
      behind += on.solver().committed().F[p] != on.points->state[p];
    }
  }
  EXPECT_GT(behind, 0);
}

TEST(ReusedAnswers, TheFirstTrialOfAStepIsEvaluatedEverywhereAlsoAfterARejectedOne) {
  Reusing on(0.9);
  for (int i = 0; i < 9; ++i) on.step();
  EXPECT_FALSE(on.solver().solve_step(3e3).converged) << "to be rejected";
  on.step();
  const std::vector<Tensor2>& first = on.points->asked.front();
  for (std::size_t p = 0; p < first.size(); ++p) EXPECT_NE(first[p], on.points->before[p]) << p;
  EXPECT_GT(on.points->asked.size(), 1U);
}

TEST(ReusedAnswers, ARestartHasTheSameBits) {
  Reusing whole(0.3), first(0.3), second(0.3);
  for (int i = 0; i < kSteps; ++i) whole.step();
  for (int i = 0; i < kSteps - 4; ++i) first.step();
  ASSERT_NE(first.points->state, first.solver().committed().F) << "states behind the mesh, or it would be easy";
  NamedArrays arrays;
  first.solver().save(arrays);
  second.points->load(first.points->save());
  second.solver().load(arrays);
  for (int i = kSteps - 4; i < kSteps; ++i) second.step();
  EXPECT_EQ(second.solver().committed().x, whole.solver().committed().x);
  EXPECT_EQ(second.points->state, whole.points->state);
}

/// What a point's tangent makes of a change of F is what the operator makes of it, and a rotation costs nothing.
TEST(ReusedAnswers, PredictionFollowsTheOperatorAndRotationsExactly) {
  LearnedTangent tangent(isotropic_stiffness(1e7, 2e7), kPlaneStrain, {});
  Tensor2 stress, F, dF;
  stress << -2e5, 3e4, 0, 3e4, -1e5, 0, 0, 0, -1.2e5;
  F << 1.01, 0.02, 0, -0.01, 0.97, 0, 0, 0, 1;
  dF << 1e-6, -2e-6, 0, 3e-6, -2e-6, 0, 0, 0, 0;
  tangent.begin_step(Tensor2::Identity(), Tensor2::Zero());
  const Tensor2 change = first_piola(tangent.predict(F + dF, F, stress), F + dF) - first_piola(stress, F);
  const Tensor4 dPdF = tangent.piola(F, stress);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      double expected = 0;
      for (int k = 0; k < 9; ++k) expected += dPdF(pair(i, j), k) * dF(k / 3, k % 3);
      EXPECT_NEAR(change(i, j), expected, 1e-4 * change.norm()) << i << j;
    }
  }
  Tensor2 Q;
  Q << 0.8, -0.6, 0, 0.6, 0.8, 0, 0, 0, 1;
  EXPECT_LE((tangent.predict(Q * F, F, stress) - rotate(stress, Q)).norm(), 1e-12 * stress.norm());
}

}  // namespace
}  // namespace femxdem
