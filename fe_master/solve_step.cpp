#include "solve_step.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <random>

#include "convergence.hpp"
#include "errors.hpp"

namespace femxdem {
namespace {

constexpr double kGapTolerance = 1e-2;  // of the second-gradient constraint, over the step's micro gradient

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::vector<Tensor2> stresses(const std::vector<Response>& responses) {
  std::vector<Tensor2> values;
  for (const Response& r : responses) values.push_back(r.stress);
  return values;
}

int largest(const std::vector<double>& values) {
  return static_cast<int>(std::max_element(values.begin(), values.end()) - values.begin());
}

std::vector<Response> undeformed(MaterialPoints& points, std::span<const Tensor2> F) {
  points.begin_step();
  std::vector<Response> responses = points.evaluate(F, Operator::elastic);
  for (const Response& r : responses) {
    if (r.failure) throw UserError(describe(*r.failure));
  }
  return responses;
}

/// What else a step asks for whose force residual was met.
std::string unmet(const StepResult& result) {
  const auto best = std::min_element(result.table.begin(), result.table.end(),
                                     [](const Iteration& a, const Iteration& b) { return a.residual < b.residual; });
  return fmt::format(
      "; the forces balance there, but displacement correction ({:.1e}) or constraint ({:.1e}) are not within "
      "tolerance",
      best->correction, best->gap);
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
      committed_{
          0, Eigen::VectorXd::Zero(element.unknowns()), element.multipliers(), loads.released_factor(0), {}, {}, {},
          {}},
      last_external_change_(Eigen::VectorXd::Zero(element.unknowns())),
      operators_(parameters,
                 committed_.responses = undeformed(points, committed_.F = element.deformation(committed_.x))) {
  points_.commit();
  committed_.internal = assembler_.force(committed_.x, committed_.F, stresses(committed_.responses));
  committed_.external = loads_.external_force(committed_.x, 0);
}

StepResult NonlinearSolver::solve_step(double dt, const std::optional<MeasureTarget>& target) {
  StepResult result;
  target_ = target;
  Equilibrium trial = committed_, best;
  begin_step(trial, dt);
  ResidualHistory history(parameters_.tolerance);
  AndersonAcceleration accelerate = acceleration();
  LineSearch search(parameters_.line_search ? 1.0 : std::numeric_limits<double>::infinity());
  Eigen::VectorXd z, change;

  while (result.iterations() < parameters_.max_iterations) {
    Iteration& now = result.table.emplace_back();
    if (!evaluate(trial, result)) return result;
    const Eigen::VectorXd residual = scaled_residual(trial);
    now.residual = residual.norm();
    now.element = largest(of_elements(residual));
    history.add(now.residual);
    if (result.reason = history.hopeless(operators_.memoryless()); !result.reason.empty()) break;
    if (now.residual > parameters_.tolerance && search.rejects(now.residual)) {
      now.note = fmt::format("line search: {:.2g} of the change next", search.fraction());
      move(trial, z + search.fraction() * change);
      continue;
    }
    const auto correction = correct(trial, now);
    if (!correction) {
      result.reason = "the matrix of the iteration is singular; hold the body, or take a smaller step";
      break;
    }
    if (converged(now)) {
      result.converged = true;
      commit(trial, dt);
      return result;
    }
    if (now.residual <= history.least()) best = trial;
    z = unknowns(trial);
    change = accelerate.change(z, *correction);
    search.start(now.residual);
    move(trial, z + change);
  }
  if (accept_best(best, result)) {
    commit(best, dt);
  } else if (result.reason.empty() && !result.failure) {
    result.reason = history.verdict();
    if (history.least() <= parameters_.tolerance) result.reason += unmet(result);
  }
  return result;
}

void NonlinearSolver::begin_step(Equilibrium& trial, double dt) {
  element_.begin_step(trial.x);
  points_.begin_step();
  operators_.begin_step(committed_.F, committed_.responses);
  factorised_in_step_ = false;
  trial.time = committed_.time + dt;
  predict(trial, dt);
  const bool reaches_start = committed_.time <= parameters_.start_time && trial.time > parameters_.start_time;
  if (parameters_.start_amplitude > 0 && reaches_start) start_at_random(trial);
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
  trial.load_factor =
      target_ ? committed_.load_factor + factor * last_factor_change_ : loads_.released_factor(trial.time);
  const Eigen::VectorXd external = loads_.external_force(trial.x, trial.time, trial.load_factor);
  const Eigen::VectorXd residual = external - factor * last_external_change_ - committed_.internal;
  if (const auto c = correction(committed_, trial.x, residual, change)) {
    trial.x += c->x;
    trial.load_factor += c->load_factor;
    element_.update_multipliers(trial.x);
  }
  trial.multipliers = element_.multipliers();
  for (std::size_t i = 0; i < prescribed_.size(); ++i) {
    trial.x[prescribed_[i]] = target[static_cast<Eigen::Index>(i)];
  }
}

/// Directional search (Chambon, Caillerie and Matsushima 2001): the free displacements start start_amplitude times the
/// predicted change away from it, in a random direction given by the seed, so that other solutions of the step can be
/// found. Uniform numbers straight from the generator: equal on all platforms.
void NonlinearSolver::start_at_random(Equilibrium& trial) const {
  const int displacements = 2 * static_cast<int>(element_.mesh().nodes.size());
  std::mt19937 generator(static_cast<unsigned>(parameters_.start_seed));
  Eigen::VectorXd direction = Eigen::VectorXd::Zero(displacements);
  for (const int i : assembler_.free()) {
    if (i < displacements) direction[i] = 2.0 * generator() / static_cast<double>(std::mt19937::max()) - 1;
  }
  const double moved = (trial.x - committed_.x).head(displacements).norm();
  trial.x.head(displacements) += parameters_.start_amplitude * moved / direction.norm() * direction;
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
  trial.external = loads_.external_force(trial.x, trial.time, trial.load_factor);
  now.evaluate_seconds = seconds_since(start);
  return true;
}

/// Solves K dx = residual - constraints at x for the free unknowns, K of the state `at`; `change`: of the prescribed
/// unknowns. Nothing when K is singular.
std::optional<NonlinearSolver::Correction> NonlinearSolver::correction(const Equilibrium& at, const Eigen::VectorXd& x,
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
  Correction c{change, 0};
  c.x(free) = linear_solver_.solve(rhs);
  if (target_ && !add_load_factor(x, c)) return std::nullopt;
  return c;
}

/// Bordered system K dx = r + dmu f, c . dx = target - m(x): a second back-solve for f, dx = d1 + dmu d2. False when f
/// does not move the measure.
bool NonlinearSolver::add_load_factor(const Eigen::VectorXd& x, Correction& c) const {
  const std::vector<int>& free = assembler_.free();
  const Eigen::VectorXd f = loads_.released_force(x);
  Eigen::VectorXd d2 = Eigen::VectorXd::Zero(x.size());
  d2(free) = linear_solver_.solve(f(free));
  const Eigen::VectorXd gradient = target_->measure->gradient(x);
  c.load_factor = (target_->value - target_->measure->value(x) - gradient.dot(c.x)) / gradient.dot(d2);
  c.x += c.load_factor * d2;
  return std::isfinite(c.load_factor);
}

/// How far the constraints are from being met.
double NonlinearSolver::gap(const Equilibrium& trial) const {
  const double of_element = element_.constraint_gap(trial.x);
  if (!target_) return of_element;
  const double missing = target_->value - target_->measure->value(trial.x);
  return std::max(of_element, std::abs(missing / (target_->value - target_->measure->value(committed_.x))));
}

/// The change of the unknowns that the operator asks for at a trial; its size goes to the iteration.
std::optional<Eigen::VectorXd> NonlinearSolver::correct(const Equilibrium& trial, Iteration& now) {
  const auto start = std::chrono::steady_clock::now();
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(element_.unknowns());
  const auto c = correction(trial, trial.x, trial.external - trial.internal, none);
  now.solve_seconds = seconds_since(start);
  now.gap = gap(trial);
  if (!c) return std::nullopt;
  const int displacements = 2 * static_cast<int>(element_.mesh().nodes.size());
  const double moved = (trial.x - committed_.x).head(displacements).norm();
  now.correction = moved > 0 ? c->x.head(displacements).norm() / moved : 0;
  Equilibrium corrected;
  corrected.x = trial.x + c->x;
  corrected.load_factor = trial.load_factor + c->load_factor;
  element_.update_multipliers(corrected.x);
  corrected.multipliers = element_.multipliers();
  element_.set_multipliers(trial.multipliers);
  return unknowns(corrected) - unknowns(trial);
}

/// All that an iteration changes in one vector: unknowns and multipliers of the element, factor of the released loads.
Eigen::VectorXd NonlinearSolver::unknowns(const Equilibrium& trial) const {
  Eigen::VectorXd z(trial.x.size() + trial.multipliers.size() + 1);
  z << trial.x, trial.multipliers, trial.load_factor;
  return z;
}

void NonlinearSolver::move(Equilibrium& trial, const Eigen::VectorXd& z) {
  trial.x = z.head(trial.x.size());
  trial.multipliers = z.segment(trial.x.size(), trial.multipliers.size());
  trial.load_factor = z[z.size() - 1];
  element_.set_multipliers(trial.multipliers);
}

/// Anderson's least squares see displacements and micro gradients times the element size; multipliers follow.
AndersonAcceleration NonlinearSolver::acceleration() const {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(unknowns(committed_).size());
  for (const int i : assembler_.free()) weights[i] = element_.residual_length(i);
  const int depth = parameters_.acceleration == Acceleration::anderson ? parameters_.anderson_depth : 0;
  return {depth, parameters_.anderson_truncation, std::move(weights)};
}

/// Out-of-balance forces of all unknowns as forces, over the norm of the reactions and external forces; 0 where
/// prescribed.
Eigen::VectorXd NonlinearSolver::scaled_residual(const Equilibrium& state) const {
  Eigen::VectorXd residual = state.external - state.internal;
  for (Eigen::Index i = 0; i < residual.size(); ++i) residual[i] /= element_.residual_length(static_cast<int>(i));
  double reactions = 0;
  for (const int i : prescribed_) {
    reactions += residual[i] * residual[i];
    residual[i] = 0;
  }
  const double scale = std::max(std::sqrt(reactions), state.external.norm());
  return scale > 0 ? Eigen::VectorXd(residual / scale) : residual;
}

double NonlinearSolver::relative_residual(const Equilibrium& state) const { return scaled_residual(state).norm(); }

std::vector<double> NonlinearSolver::element_residuals(const Equilibrium& state) const {
  return of_elements(scaled_residual(state));
}

/// Norms of a residual over the unknowns of each element.
std::vector<double> NonlinearSolver::of_elements(const Eigen::VectorXd& residual) const {
  std::vector<double> norms;
  for (std::size_t e = 0; e < element_.mesh().elements.size(); ++e)
    norms.push_back(residual(element_.dofs(static_cast<int>(e))).norm());
  return norms;
}

bool NonlinearSolver::converged(const Iteration& iteration) const {
  return iteration.residual <= parameters_.tolerance && iteration.correction <= parameters_.displacement_tolerance &&
         iteration.gap <= kGapTolerance;
}

/// Takes the best iterate where the case allows it (a factor above 1); the points are strained to it again unless they
/// are there.
bool NonlinearSolver::accept_best(Equilibrium& best, StepResult& result) {
  if (parameters_.accept_best_factor <= 1 || best.x.size() == 0 || result.failure) return false;
  const double residual = relative_residual(best);
  if (residual > parameters_.accept_best_factor * parameters_.tolerance) return false;
  Iteration& now = result.table.emplace_back();
  element_.set_multipliers(best.multipliers);
  if (!evaluate(best, result)) return false;
  now.residual = relative_residual(best);
  now.gap = gap(best);
  now.note = "best iterate, accepted above the tolerance";
  result.reason.clear();
  result.converged = result.best_accepted = true;
  return true;
}

void NonlinearSolver::commit(Equilibrium& trial, double dt) {
  points_.commit();
  element_.commit(trial.x);
  last_external_change_ = trial.external - committed_.external;
  last_dt_ = dt;
  last_factor_change_ = trial.load_factor - committed_.load_factor;
  committed_ = std::move(trial);
  element_.begin_step(committed_.x);
}

void NonlinearSolver::save(NamedArrays& arrays) const {
  element_.save(arrays);
  operators_.save(arrays);
  arrays.emplace_back("solver.time",
                      std::vector<double>{committed_.time, last_dt_, committed_.load_factor, last_factor_change_});
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
  committed_.load_factor = find_array(arrays, "solver.time").at(2);
  last_factor_change_ = find_array(arrays, "solver.time").at(3);
  const auto& change = find_array(arrays, "solver.last_external_change");
  last_external_change_ = Eigen::Map<const Eigen::VectorXd>(change.data(), static_cast<Eigen::Index>(change.size()));
  element_.begin_step(committed_.x);
  committed_.multipliers = element_.multipliers();
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
  committed_.external = loads_.external_force(committed_.x, committed_.time, committed_.load_factor);
}

SolverParameters with_default_tolerances(SolverParameters parameters, bool volume_elements) {
  if (!is_given(parameters.tolerance)) parameters.tolerance = volume_elements ? 5e-3 : 1e-8;
  if (!is_given(parameters.displacement_tolerance)) parameters.displacement_tolerance = volume_elements ? 0.1 : 1e-6;
  if (!is_given(parameters.qn_first)) parameters.qn_first = volume_elements ? 0 : 1;
  return parameters;
}

}  // namespace femxdem
