#include <gtest/gtest.h>

#include <cmath>

#include "softening_problem.hpp"

namespace femxdem {
namespace {

SolverParameters learning(double tolerance) { return solver_parameters(GlobalOperator::quasi_newton, tolerance, 15); }

// Cost of the learned tangents against the exact ones, second-gradient biaxial test through its peak.
TEST(Solver, LearnedTangentsCostAtMostHalfAsMuchAgainAsNewtonWithLineSearch) {
  SolverParameters newton = solver_parameters(GlobalOperator::tangent, 5e-3, 15);
  newton.line_search = true;
  SofteningProblem exact = softening_biaxial(8, 2e3, newton), learned = softening_biaxial(8, 2e3, learning(5e-3));
  const SeriesCost reference = run_to(exact, 24, 1), cost = run_to(learned, 24, 1);
  RecordProperty("newton_with_line_search", reference.evaluations);
  RecordProperty("learned", cost.evaluations);
  EXPECT_TRUE(cost.finished);
  EXPECT_EQ(cost.failures, 0) << cost.reason;
  EXPECT_LE(cost.evaluations, 1.5 * reference.evaluations);
}

// Newton's method without a line search stops at the same peak at a tighter tolerance; the learned tangents go on.
TEST(Solver, LearnedTangentsPassThePeakWhereNewtonCycles) {
  SofteningProblem exact = softening_biaxial(8, 2e3, solver_parameters(GlobalOperator::tangent, 1e-3, 15));
  const SeriesCost naive = run_to(exact, 18, 1);
  EXPECT_FALSE(naive.finished) << "the failing twin";
  RecordProperty("newton", naive.reason);
  SofteningProblem learned = softening_biaxial(8, 2e3, learning(1e-3));
  const SeriesCost cost = run_to(learned, 18, 1);
  EXPECT_TRUE(cost.finished);
  EXPECT_EQ(cost.failures, 0) << cost.reason;
}

TEST(Solver, BestIterateIsAcceptedOnlyWhereTheCaseAllowsItAndIsCommitted) {
  SolverParameters elastic = solver_parameters(GlobalOperator::elastic, 1e-5, 6);
  SofteningProblem refused = softening_biaxial(4, 0, elastic);
  ASSERT_TRUE(refused.solver->solve_step(6).converged) << "still elastic";
  const StepResult no = refused.solver->solve_step(3);
  ASSERT_FALSE(no.converged);
  EXPECT_FALSE(no.best_accepted);
  double least = 1;
  for (const Iteration& i : no.table) least = std::min(least, i.residual);

  elastic.accept_best_factor = 1e5;
  SofteningProblem accepted = softening_biaxial(4, 0, elastic);
  ASSERT_TRUE(accepted.solver->solve_step(6).converged);
  const StepResult yes = accepted.solver->solve_step(3);
  ASSERT_TRUE(yes.converged);
  EXPECT_TRUE(yes.best_accepted);
  EXPECT_EQ(yes.table.back().residual, least);
  EXPECT_EQ(accepted.solver->relative_residual(accepted.solver->committed()), least);
  EXPECT_EQ(yes.evaluations, no.evaluations + 1) << "the points are strained to it again";
}

TEST(Solver, RandomStartIsSeededAndHarmlessWhereTheSolutionIsUnique) {
  SolverParameters p = learning(1e-8);
  const auto after_one_step = [&](double amplitude, int seed) {
    p.start_amplitude = amplitude;
    p.start_seed = seed;
    SofteningProblem problem = softening_biaxial(4, 0, p);
    const StepResult result = problem.solver->solve_step(1);
    EXPECT_TRUE(result.converged) << result.reason;
    return std::pair{problem.solver->committed().x, result.evaluations};
  };
  const auto [plain, few] = after_one_step(0, 1);
  const auto [first, more] = after_one_step(0.01, 1);
  EXPECT_GT(more, few) << "the start was disturbed";
  EXPECT_LT((first - plain).norm(), 1e-6 * plain.norm());
  EXPECT_EQ(after_one_step(0.01, 1).first, first) << "equal seeds, equal bits";
  EXPECT_NE(after_one_step(0.01, 2).first, first);
}

}  // namespace
}  // namespace femxdem
