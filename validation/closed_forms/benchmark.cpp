// Time of an equilibrium iteration of second-gradient elements on a law in closed form, one core.
#include <benchmark/benchmark.h>

#include "analytic_points.hpp"
#include "learned_tangent.hpp"
#include "linear_solver.hpp"
#include "saddle.hpp"
#include "second_gradient_q8.hpp"

namespace femxdem {
namespace {

/// Evaluation of the law, assembly, factorisation and solution on nx x 2 nx elements, unknowns away from 0.
void iteration(benchmark::State& state, bool symmetric) {
  const int nx = static_cast<int>(state.range(0));
  const MixedProblem problem(nx, 2 * nx, 12);
  const SecondGradientQ8 element(problem.mesh, one_parameter_law(12));
  AnalyticPoints points(
      std::vector<AnalyticLaw>(element.points(), DruckerPragerLaw{1000, 0.25, 2, 0.5, 0.2, -20, 1, 3}));
  Assembler assembler(element, problem.prescribed);
  LinearSolver solver;
  Eigen::VectorXd x(element.unknowns());
  for (int i = 0; i < x.size(); ++i) x[i] = 1e-4 / nx * std::sin(1.7 * i);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(element.unknowns());
  const Eigen::VectorXd lambda = Eigen::VectorXd::Zero(element.multipliers());
  for (auto _ : state) {
    const auto F = element.deformation(x);
    const auto responses = points.evaluate(F, symmetric ? Operator::elastic : Operator::tangent);
    std::vector<Tensor2> stress;
    std::vector<Tensor4> dPdF;
    for (std::size_t p = 0; p < F.size(); ++p) {
      const Response& r = responses[p];
      stress.push_back(r.stress);
      dPdF.push_back(symmetric ? piola_elastic(r.stiffness, F[p]) : piola_tangent(r.stiffness, r.stress, F[p]));
    }
    const Eigen::VectorXd f = assembler.force({x, lambda, F}, stress);
    Eigen::VectorXd rhs = f(assembler.free());
    const SparseMatrix& K = assembler.matrix({x, F, dPdF, !symmetric, 100 * 1200}, none, rhs);
    if (!solver.factorise(K, symmetric)) state.SkipWithError("singular");
    benchmark::DoNotOptimize(solver.solve(rhs));
  }
  state.counters["unknowns"] = static_cast<double>(assembler.free().size());
}

void factorise(benchmark::State& state, const SparseMatrix& K, bool symmetric) {
  LinearSolver solver;
  const Eigen::VectorXd b = Eigen::VectorXd::Ones(K.rows());
  for (auto _ : state) {
    if (!solver.factorise(K, symmetric)) state.SkipWithError("singular");
    benchmark::DoNotOptimize(solver.solve(b));
  }
  state.counters["unknowns"] = static_cast<double>(K.rows());
}

void symmetric_iteration(benchmark::State& state) { iteration(state, true); }
void unsymmetric_iteration(benchmark::State& state) { iteration(state, false); }
void solve_augmented_cholmod(benchmark::State& state) {
  const int nx = static_cast<int>(state.range(0));
  factorise(state, MixedProblem(nx, 2 * nx, 12).augmented(100 * 1200), true);
}
void solve_augmented_umfpack(benchmark::State& state) {
  const int nx = static_cast<int>(state.range(0));
  factorise(state, MixedProblem(nx, 2 * nx, 12).augmented(100 * 1200), false);
}
void solve_saddle_umfpack(benchmark::State& state) {
  const int nx = static_cast<int>(state.range(0));
  factorise(state, MixedProblem(nx, 2 * nx, 12).saddle(1200), false);
}

BENCHMARK(symmetric_iteration)->Arg(8)->Arg(16)->Arg(32)->Arg(64)->Unit(benchmark::kMillisecond);
BENCHMARK(unsymmetric_iteration)->Arg(8)->Arg(16)->Arg(32)->Arg(64)->Unit(benchmark::kMillisecond);
BENCHMARK(solve_augmented_cholmod)->Arg(16)->Arg(32)->Unit(benchmark::kMillisecond);
BENCHMARK(solve_augmented_umfpack)->Arg(16)->Arg(32)->Unit(benchmark::kMillisecond);
BENCHMARK(solve_saddle_umfpack)->Arg(16)->Arg(32)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace femxdem

int main(int argc, char** argv) {
  setenv("OPENBLAS_NUM_THREADS", "1", 1);
  setenv("OMP_NUM_THREADS", "1", 1);
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
