#include "solve_step.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "errors.hpp"

namespace femxdem {
namespace {

constexpr double kGapTolerance = 1e-2;  // of the second-gradient constraint, over the step's micro gradient
constexpr double kDivergence = 1e3;     // residual over the step's smallest

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::vector<Tensor2> stresses(const std::vector<Response>& responses) {
  std::vector<Tensor2> values;
  for (const Response& r : responses) values.push_back(r.stress);
  return values;
}

std::vector<Response> undeformed(MaterialPoints& points, std::span<const Tensor2> F) {
  points.begin_step();
  std::vector<Response> responses = points.evaluate(F, Operator::elastic);
  for (const Response& r : responses) {
    if (r.failure) throw UserError(r.failure->sentence + " " + r.failure->advice);
  }
  return responses;
}

}  // namespace

NonlinearSolver::NonlinearSolver(Element& element, MaterialPoints& points, const Loads& loads,
                                 const SolverParameters& parameters)
    : element_(element),
      points_(points),
      loads_(loads),
      parameters_(parameters),
      prescribed_(loads.prescribed_dofs()),
      assembler_(element, prescribed_),
      committed_{0, Eigen::VectorXd::Zero(element.unknowns()), {}, {}, {}, {}},
      last_external_change_(Eigen::VectorXd::Zero(element.unknowns())),
      operators_(parameters,
                 committed_.responses = undeformed(points, committed_.F = element.deformation(committed_.x))) {
  points_.commit();
  committed_.internal = assembler_.force(committed_.x, committed_.F, stresses(committed_.responses));
  committed_.external = loads_.external_force(committed_.x, 0);
}

StepResult NonlinearSolver::solve_step(double dt) {
  StepResult result;
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(element_.unknowns());
  Equilibrium trial = committed_, best;
  double least = std::numeric_limits<double>::infinity();
  element_.begin_step(trial.x);
  points_.begin_step();
  operators_.begin_step(committed_.F, committed_.responses);
  factorised_in_step_ = false;
  trial.time = committed_.time + dt;
  predict(trial, dt);

  while (result.iterations() < parameters_.max_iterations) {
    Iteration& now = result.table.emplace_back();
    if (!evaluate(trial, result)) return result;
    now.residual = relative_residual(trial);
    now.gap = element_.constraint_gap(trial.x);
    if (!std::isfinite(now.residual) || now.residual > kDivergence * least) {
      result.reason = fmt::format("diverged: residual {:.1e} after {:.1e}", now.residual, least);
      return result;
    }
    const auto start = std::chrono::steady_clock::now();
    const auto dx = correction(trial, trial.x, trial.external - trial.internal, none);
    now.solve_seconds = seconds_since(start);
    if (!dx) {
      result.reason = "the matrix of the iteration is singular";
      return result;
    }
    const int displacements = 2 * static_cast<int>(element_.mesh().nodes.size());
    const double moved = (trial.x - committed_.x).head(displacements).norm();
    now.correction = moved > 0 ? dx->head(displacements).norm() / moved : 0;
    if (converged(now)) {
      result.converged = true;
      commit(trial, dt);
      return result;
    }
    if (now.residual < least) {
      least = now.residual;
      best = trial;
    }
    trial.x += *dx;
    element_.update_multipliers(trial.x);
  }
  result.reason = fmt::format("not converged in {} iterations: least residual {:.1e}, tolerance {:.1e}",
                              result.iterations(), least, parameters_.tolerance);
  return result;
}

/// Start of the iterations: the last step's increment extrapolated, corrected for the carried residual, the change of
/// the loads and the prescribed values; an elastic predictor where there is no last increment.
void NonlinearSolver::predict(Equilibrium& trial, double dt) {
  const double factor = parameters_.predictor == Predictor::extrapolate && last_dt_ > 0 ? dt / last_dt_ : 0;
  element_.extrapolate(trial.x, factor);
  const Eigen::VectorXd target = loads_.prescribed(committed_.time, trial.time);
  Eigen::VectorXd change = Eigen::VectorXd::Zero(element_.unknowns());
  for (std::size_t i = 0; i < prescribed_.size(); ++i) {
    change[prescribed_[i]] = target[static_cast<Eigen::Index>(i)] - trial.x[prescribed_[i]];
  }
  const Eigen::VectorXd external = loads_.external_force(trial.x, trial.time);
  const Eigen::VectorXd residual = external - factor * last_external_change_ - committed_.internal;
  if (const auto dx = correction(committed_, trial.x, residual, change)) {
    trial.x += *dx;
    element_.update_multipliers(trial.x);
  }
  for (std::size_t i = 0; i < prescribed_.size(); ++i) {
    trial.x[prescribed_[i]] = target[static_cast<Eigen::Index>(i)];
  }
}

/// F -> responses -> internal and external force of the trial; false when a point has failed.
bool NonlinearSolver::evaluate(Equilibrium& trial, StepResult& result) {
  Iteration& now = result.table.back();
  const auto start = std::chrono::steady_clock::now();
  trial.F = element_.deformation(trial.x);
  trial.responses = points_.evaluate(trial.F, operators_.wanted());
  ++result.evaluations;
  for (const Response& r : trial.responses) {
    if (r.failure) {
      result.failure = r.failure;
      result.reason = r.failure->sentence;
      return false;
    }
    result.dem_steps += r.report["dem_steps"];
    now.engine_seconds += r.report["engine_seconds"];
    now.longest_point = std::max(now.longest_point, r.report["seconds"]);
  }
  operators_.learn(trial.F, trial.responses);
  if (const int probes = operators_.probe(points_, trial.F, trial.responses); probes > 0) {
    result.evaluations += probes + 1;
    trial.responses = points_.evaluate(trial.F, operators_.wanted());  // the trial to be committed is the last one
  }
  trial.internal = assembler_.force(trial.x, trial.F, stresses(trial.responses));
  trial.external = loads_.external_force(trial.x, trial.time);
  now.evaluate_seconds = seconds_since(start);
  return true;
}

/// Solves K dx = residual - constraints at x for the free unknowns, K of the state `at`; `change`: of the prescribed
/// unknowns. Nothing when K is singular.
std::optional<Eigen::VectorXd> NonlinearSolver::correction(const Equilibrium& at, const Eigen::VectorXd& x,
                                                           const Eigen::VectorXd& residual,
                                                           const Eigen::VectorXd& change) {
  const std::vector<int>& free = assembler_.free();
  const Eigen::VectorXd balance = residual - assembler_.constraint_force(x);
  Eigen::VectorXd rhs = balance(free);
  if (!factorised_in_step_ || !operators_.constant_in_step()) {
    const auto dPdF = operators_.piola(at.F, at.responses);
    const SparseMatrix& K = assembler_.matrix(at.x, at.F, dPdF, !operators_.symmetric(), change, rhs);
    if (!linear_solver_.factorise(K, operators_.symmetric())) return std::nullopt;
    factorised_in_step_ = true;
  }
  Eigen::VectorXd dx = change;
  dx(free) = linear_solver_.solve(rhs);
  return dx;
}

double NonlinearSolver::relative_residual(const Equilibrium& state) const {
  double free = 0, reactions = 0;
  const Eigen::VectorXd out_of_balance = state.external - state.internal;
  for (const int i : assembler_.free()) free += std::pow(out_of_balance[i] / element_.residual_length(i), 2);
  for (const int i : prescribed_) reactions += std::pow(out_of_balance[i] / element_.residual_length(i), 2);
  const double scale = std::max(std::sqrt(reactions), state.external.norm());
  return scale > 0 ? std::sqrt(free) / scale : std::sqrt(free);
}

bool NonlinearSolver::converged(const Iteration& iteration) const {
  return iteration.residual <= parameters_.tolerance && iteration.correction <= parameters_.displacement_tolerance &&
         iteration.gap <= kGapTolerance;
}

void NonlinearSolver::commit(Equilibrium& trial, double dt) {
  points_.commit();
  element_.commit(trial.x);
  last_external_change_ = trial.external - committed_.external;
  last_dt_ = dt;
  committed_ = std::move(trial);
  element_.begin_step(committed_.x);
}

void NonlinearSolver::save(NamedArrays& arrays) const {
  element_.save(arrays);
  operators_.save(arrays);
  arrays.emplace_back("solver.time", std::vector<double>{committed_.time, last_dt_});
  const auto& change = last_external_change_;
  arrays.emplace_back("solver.last_external_change", std::vector<double>(change.data(), change.data() + change.size()));
  const auto& internal = committed_.internal;
  arrays.emplace_back("solver.internal", std::vector<double>(internal.data(), internal.data() + internal.size()));
  std::vector<double> answers;
  for (const Response& r : committed_.responses) {
    answers.insert(answers.end(), r.stress.data(), r.stress.data() + 9);
    answers.insert(answers.end(), r.stiffness.data(), r.stiffness.data() + 81);
    answers.insert(answers.end(), r.report.values.begin(), r.report.values.end());
  }
  arrays.emplace_back("solver.responses", std::move(answers));
}

void NonlinearSolver::load(const NamedArrays& arrays) {
  element_.load(arrays);
  operators_.load(arrays);
  committed_.time = find_array(arrays, "solver.time").at(0);
  last_dt_ = find_array(arrays, "solver.time").at(1);
  const auto& change = find_array(arrays, "solver.last_external_change");
  last_external_change_ = Eigen::Map<const Eigen::VectorXd>(change.data(), static_cast<Eigen::Index>(change.size()));
  element_.begin_step(committed_.x);
  committed_.F = element_.deformation(committed_.x);
  const double* value = find_array(arrays, "solver.responses").data();
  for (Response& r : committed_.responses) {
    std::copy_n(value, 9, r.stress.data());
    std::copy_n(value + 9, 81, r.stiffness.data());
    std::copy_n(value + 90, r.report.values.size(), r.report.values.begin());
    value += 90 + r.report.values.size();
  }
  const auto& internal = find_array(arrays, "solver.internal");
  committed_.internal = Eigen::Map<const Eigen::VectorXd>(internal.data(), static_cast<Eigen::Index>(internal.size()));
  committed_.external = loads_.external_force(committed_.x, committed_.time);
}

SolverParameters with_default_tolerances(SolverParameters parameters, bool volume_elements) {
  if (!is_given(parameters.tolerance)) parameters.tolerance = volume_elements ? 5e-3 : 1e-8;
  if (!is_given(parameters.displacement_tolerance)) parameters.displacement_tolerance = volume_elements ? 0.1 : 1e-6;
  return parameters;
}

}  // namespace femxdem
