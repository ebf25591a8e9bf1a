#include "nonlinear_solver.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <chrono>
#include <cmath>
#include <limits>
#include <random>

#include "errors.hpp"
#include "seconds_since.hpp"

namespace femxdem {
namespace {

constexpr double kGapTolerance = 1e-2;  // of the second-gradient constraint, over the step's micro gradient

std::vector<Tensor2> stresses(const std::vector<Response>& responses) {
  std::vector<Tensor2> values;
  for (const Response& r : responses) values.push_back(r.stress);
  return values;
}

void add(NamedArrays& arrays, const std::string& name, const Eigen::VectorXd& values) {
  arrays.emplace_back(name, std::vector<double>(values.begin(), values.end()));
}

Eigen::VectorXd find_vector(const NamedArrays& arrays, const std::string& name) {
  const std::vector<double>& values = find_array(arrays, name);
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

int largest(const std::vector<double>& values) {
  return static_cast<int>(std::max_element(values.begin(), values.end()) - values.begin());
}

/// The state at time 0 but for its forces: no displacements, and what the points answer to them.
Equilibrium undeformed(const Formulation& formulation, MaterialPoints& points, const Loads& loads) {
  Equilibrium state;
  state.x = Eigen::VectorXd::Zero(formulation.unknowns());
  state.multipliers = Eigen::VectorXd::Zero(formulation.multipliers());
  state.load_factor = loads.released_factor(0);
  state.leaving = state.x;
  state.F = formulation.deformation(state.x);
  points.begin_step();
  state.responses = points.evaluate(state.F, Operator::elastic);
  for (const Response& r : state.responses) {
    if (r.failure) throw UserError(describe(*r.failure));
  }
  return state;
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

NonlinearSolver::NonlinearSolver(Formulation& formulation, MaterialPoints& points, const Loads& loads,
                                 const SolverParameters& parameters)
    : formulation_(formulation),
      points_(points, parameters.answer_at),
      loads_(loads),
      parameters_(parameters),
      prescribed_(loads.prescribed_dofs()),
      assembler_(formulation, prescribed_),
      committed_(undeformed(formulation, points, loads)),
      start_{0, committed_.x, committed_.multipliers, committed_.load_factor, committed_.leaving},
      last_{0, start_.lacking, committed_.multipliers, start_.lacking, 0},
      operators_(parameters, committed_.responses, formulation.strain_components()),
      reuse_(parameters.reuse_below, points.size()),
      contraction_(parameters.tolerance, parameters.tolerance_over_noise),
      lagging_(learns_ends(parameters), points_),
      penalty_(parameters.penalty * committed_.responses.front().stiffness(pair(0, 0), pair(0, 0))) {
  assert(parameters.reuse_below == 0 || parameters.answer_at == 1);
  points_.commit();
  committed_.internal = assembler_.force(committed_.configuration(), stresses(committed_.responses));
  committed_.external = loads_.external_force(committed_.x, 0);
  if (points_.theta() < 1) start_.lacking = -free_part(committed_.out_of_balance());
}

StepResult NonlinearSolver::solve_step(double dt, const std::optional<MeasureTarget>& target) {
  StepResult result;
  result.tolerance = parameters_.tolerance;
  target_ = target;
  Equilibrium trial = committed_, best;
  begin_step(trial, dt);
  ResidualHistory history(parameters_.tolerance);
  AndersonAcceleration accelerate = acceleration();
  LineSearch search(parameters_.line_search ? 1.0 : std::numeric_limits<double>::infinity());
  Eigen::VectorXd z, change;

  while (result.iterations() < parameters_.max_iterations) {
    if (result.stopped = told_to_end_(); result.stopped) return result;
    Iteration& now = result.table.emplace_back();
    if (!evaluate(trial, result)) return result;
    const Eigen::VectorXd residual = scaled_residual(trial);
    now.residual = residual.norm() + now.reuse_error;
    now.element = largest(of_elements(residual));
    history.add(now.residual);
    contraction_.add(now.residual);
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
    z = unknowns(trial);
    if (converged(now) || correct_unevaluated(trial, z + *correction, result)) {
      result.converged = true;
      commit(trial, dt);
      return result;
    }
    if (now.residual - now.reuse_error <= parameters_.tolerance) reuse_.stop();
    if (now.residual <= history.least()) best = trial;
    change = accelerate.change(z, *correction);
    search.start(now.residual);
    move(trial, z + change);
  }
  give_up(best, dt, history, result);
  return result;
}

void NonlinearSolver::begin_step(Equilibrium& trial, double dt) {
  points_.begin_step();
  operators_.begin_step(committed_.F, committed_.responses);
  points_.start_from(
      lagging_.begin_step(points_.theta() == 1 ? committed_.F : formulation_.deformation(start_.x), operators_));
  reuse_.begin_step();
  contraction_.begin_step();
  factorised_in_step_ = false;
  trial.time = trial_time(dt);
  trial.leaving = (1 - points_.theta()) * start_.lacking;
  predict(trial, dt);
  const bool reaches_start = start_.time <= parameters_.start_time && start_.time + dt > parameters_.start_time;
  if (parameters_.start_amplitude > 0 && reaches_start) start_at_random(trial);
}

double NonlinearSolver::trial_time(double dt) const { return points_.within(start_.time, start_.time + dt); }

/// Start of the iterations: the last step's increment extrapolated, corrected for the carried residual, the change of
/// the loads, the prescribed values, and what the step's start lacks, with which its stresses begin; an elastic
/// predictor where there is no last increment.
void NonlinearSolver::predict(Equilibrium& trial, double dt) {
  const double factor = parameters_.predictor == Predictor::extrapolate && last_.dt > 0 ? span(dt) / last_.dt : 0;
  trial.x += factor * last_.x;
  trial.multipliers += factor * last_.multipliers;
  const Eigen::VectorXd target =
      points_.within<Eigen::VectorXd>(start_.x(prescribed_), loads_.prescribed(start_.time, start_.time + dt));
  Eigen::VectorXd change = Eigen::VectorXd::Zero(formulation_.unknowns());
  for (std::size_t i = 0; i < prescribed_.size(); ++i) {
    change[prescribed_[i]] = target[static_cast<Eigen::Index>(i)] - trial.x[prescribed_[i]];
  }
  trial.load_factor =
      target_ ? committed_.load_factor + factor * last_.load_factor : loads_.released_factor(trial.time);
  const Eigen::VectorXd external = loads_.external_force(trial.x, trial.time, trial.load_factor);
  const Eigen::VectorXd residual =
      external + trial.leaving - factor * last_.external - committed_.internal - start_.lacking;
  if (const auto c = correction(committed_, trial.x, residual, change)) {
    trial.x += c->x;
    trial.load_factor += c->load_factor;
    trial.multipliers = formulation_.updated_multipliers(trial.multipliers, trial.x, penalty_);
  }
  for (std::size_t i = 0; i < prescribed_.size(); ++i) {
    trial.x[prescribed_[i]] = target[static_cast<Eigen::Index>(i)];
  }
}

/// Directional search (Chambon, Caillerie and Matsushima 2001): the free displacements start start_amplitude times the
/// predicted change away from it, in a random direction given by the seed, so that other solutions of the step can be
/// found. Uniform numbers straight from the generator: equal on all platforms.
void NonlinearSolver::start_at_random(Equilibrium& trial) const {
  const int displacements = 2 * static_cast<int>(formulation_.mesh().nodes.size());
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
  trial.F = formulation_.deformation(trial.x);
  const std::vector<Tensor2> asked = lagging_.asked(reuse_.asked(trial.F));
  trial.responses = points_.evaluate(asked, operators_.wanted());
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
  reuse_.judge(operators_.learn(asked, trial.responses));
  if (const int probes = operators_.probe(points_, trial.F, trial.responses); probes > 0) {
    result.evaluations += probes + 1;
    trial.responses = points_.evaluate(trial.F, operators_.wanted());  // the trial to be committed is the last one
  }
  reuse_.answer(trial.F, trial.responses, operators_);
  lagging_.complete(trial.F, trial.responses);
  trial.internal = assembler_.force(trial.configuration(), stresses(trial.responses));
  trial.external = loads_.external_force(trial.x, trial.time, trial.load_factor);
  result.reused += reuse_.count();
  now.reuse_error = reuse_error(trial);
  if (reuse_.count() > 0) now.note = fmt::format("{} answers reused, error {:.1e}", reuse_.count(), now.reuse_error);
  now.evaluate_seconds = seconds_since(start);
  return true;
}

/// Out-of-balance force that belongs to what learned tangents add to reused answers, times their misfit in this step.
double NonlinearSolver::reuse_error(const Equilibrium& trial) const {
  if (reuse_.count() == 0) return 0;
  Equilibrium off = trial;
  const Eigen::VectorXd without = assembler_.force(trial.configuration(), reuse_.unmoved());
  off.internal += reuse_.misfit() * (trial.internal - without);
  return (scaled_residual(off) - scaled_residual(trial)).norm();
}

/// Solves K dx = residual - constraints at x for the free unknowns, K of the state `at`; `change`: of the prescribed
/// unknowns. Nothing when K is singular.
std::optional<NonlinearSolver::Correction> NonlinearSolver::correction(const Equilibrium& at, const Eigen::VectorXd& x,
                                                                       const Eigen::VectorXd& residual,
                                                                       const Eigen::VectorXd& change) {
  const std::vector<int>& free = assembler_.free();
  const Eigen::VectorXd balance = residual - assembler_.constraint_force(x, penalty_);
  Eigen::VectorXd rhs = balance(free);
  if (!factorised_in_step_ || !operators_.constant_in_step()) {
    const auto dPdF = operators_.piola(at.F, at.responses);
    const SparseMatrix& K = assembler_.matrix({at.x, at.F, dPdF, !operators_.symmetric(), penalty_}, change, rhs);
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
  const double of_element = formulation_.constraint_gap(trial.x);
  if (!target_) return of_element;
  const double missing = target_->value - target_->measure->value(trial.x);
  return std::max(of_element, std::abs(missing / (target_->value - target_->measure->value(committed_.x))));
}

/// The change of the unknowns that the operator asks for at a trial; its size goes to the iteration.
std::optional<Eigen::VectorXd> NonlinearSolver::correct(const Equilibrium& trial, Iteration& now) {
  const auto start = std::chrono::steady_clock::now();
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(formulation_.unknowns());
  const auto c = correction(trial, trial.x, trial.out_of_balance(), none);
  now.solve_seconds = seconds_since(start);
  now.gap = gap(trial);
  if (!c) return std::nullopt;
  const int displacements = 2 * static_cast<int>(formulation_.mesh().nodes.size());
  const double moved = (trial.x - committed_.x).head(displacements).norm();
  now.correction = moved > 0 ? c->x.head(displacements).norm() / moved : 0;
  Equilibrium corrected;
  corrected.x = trial.x + c->x;
  corrected.load_factor = trial.load_factor + c->load_factor;
  corrected.multipliers = formulation_.updated_multipliers(trial.multipliers, corrected.x, penalty_);
  return unknowns(corrected) - unknowns(trial);
}

/// All that an iteration changes in one vector: unknowns and multipliers, factor of the released loads.
Eigen::VectorXd NonlinearSolver::unknowns(const Equilibrium& trial) const {
  Eigen::VectorXd z(trial.x.size() + trial.multipliers.size() + 1);
  z << trial.x, trial.multipliers, trial.load_factor;
  return z;
}

void NonlinearSolver::move(Equilibrium& trial, const Eigen::VectorXd& z) {
  trial.x = z.head(trial.x.size());
  trial.multipliers = z.segment(trial.x.size(), trial.multipliers.size());
  trial.load_factor = z[z.size() - 1];
}

/// Anderson's least squares see displacements and micro gradients times the element size; multipliers follow.
AndersonAcceleration NonlinearSolver::acceleration() const {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(unknowns(committed_).size());
  for (const int i : assembler_.free()) weights[i] = formulation_.residual_length(i);
  const int depth = parameters_.acceleration == Acceleration::anderson ? parameters_.anderson_depth : 0;
  return {depth, parameters_.anderson_truncation, std::move(weights)};
}

/// Out-of-balance forces of all unknowns as forces, over the norm of the reactions and external forces; 0 where
/// prescribed.
Eigen::VectorXd NonlinearSolver::scaled_residual(const Equilibrium& state) const {
  Eigen::VectorXd residual = state.out_of_balance();
  for (Eigen::Index i = 0; i < residual.size(); ++i) residual[i] /= formulation_.residual_length(static_cast<int>(i));
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
  for (std::size_t e = 0; e < formulation_.mesh().elements.size(); ++e)
    norms.push_back(residual(formulation_.dofs(static_cast<int>(e))).norm());
  return norms;
}

bool NonlinearSolver::converged(const Iteration& iteration) const {
  return iteration.residual <= parameters_.tolerance && iteration.correction <= parameters_.displacement_tolerance &&
         iteration.gap <= kGapTolerance;
}

/// Ends the step with a correction, to z, to which the points answer from their learned tangents, unevaluated, where
/// the residual that is to be expected so (Contraction) is within the tolerance, as its noise may have raised it. Their
/// states stay where they were evaluated; the next step takes them from there to where the mesh is then. False: nothing
/// has happened.
bool NonlinearSolver::correct_unevaluated(Equilibrium& trial, const Eigen::VectorXd& z, StepResult& result) {
  Iteration& now = result.table.back();
  if (parameters_.last_correction == LastCorrection::evaluated) return false;
  const std::optional<double> expected = contraction_.after(now.residual);
  const double tolerance = contraction_.tolerance();
  if (!expected || *expected > tolerance || now.correction > parameters_.displacement_tolerance) return false;
  Equilibrium moved = trial;
  move(moved, z);
  moved.F = formulation_.deformation(moved.x);
  for (std::size_t p = 0; p < moved.F.size(); ++p) {
    Tensor2& stress = moved.responses[p].stress;
    stress = operators_.predict(p, moved.F[p], trial.F[p], stress);
  }
  moved.internal = assembler_.force(moved.configuration(), stresses(moved.responses));
  moved.external = loads_.external_force(moved.x, moved.time, moved.load_factor);
  const double residual = *expected + relative_residual(moved), constraints = gap(moved);
  if (residual > tolerance || constraints > kGapTolerance) return false;
  now.note = fmt::format("residual {:.1e}, its correction by learned tangents", now.residual);
  if (tolerance > parameters_.tolerance) now.note += fmt::format(", tolerance {:.1e}", tolerance);
  now.residual = residual;
  now.gap = constraints;
  result.learned_at_end = true;
  result.tolerance = tolerance;
  trial = std::move(moved);
  return true;
}

/// Takes the best iterate where the case allows it (a factor above 1); the points are strained to it again unless they
/// are there.
bool NonlinearSolver::accept_best(Equilibrium& best, StepResult& result) {
  if (parameters_.accept_best_factor <= 1 || best.x.size() == 0 || result.failure) return false;
  const double residual = relative_residual(best);
  if (residual > parameters_.accept_best_factor * parameters_.tolerance) return false;
  Iteration& now = result.table.emplace_back();
  reuse_.stop();
  if (!evaluate(best, result)) return false;
  now.residual = relative_residual(best);
  if (now.residual > parameters_.accept_best_factor * parameters_.tolerance) return false;
  now.gap = gap(best);
  now.note = "best iterate, accepted above the tolerance";
  result.reason.clear();
  result.converged = result.best_accepted = true;
  return true;
}

/// The end of a step whose iterations have not converged: its best iterate, or the reason why not.
void NonlinearSolver::give_up(Equilibrium& best, double dt, const ResidualHistory& history, StepResult& result) {
  if (accept_best(best, result)) {
    commit(best, dt);
  } else if (result.reason.empty() && !result.failure) {
    result.reason = history.verdict();
    if (history.least() <= parameters_.tolerance) result.reason += unmet(result);
  }
}

/// The end of the step of this trial, whose points are committed.
StepStart NonlinearSolver::end_of(const Equilibrium& trial, double dt) const {
  StepStart next = start_;
  next.time += dt;
  next.x = points_.end(start_.x, trial.x);
  if (points_.theta() == 1) return next;
  next.multipliers = points_.end(start_.multipliers, trial.multipliers);
  next.load_factor = target_ ? points_.end(start_.load_factor, trial.load_factor) : loads_.released_factor(next.time);
  const std::vector<Tensor2> F = formulation_.deformation(next.x);
  const Eigen::VectorXd internal =
      assembler_.force({next.x, next.multipliers, F}, lagging_.end_stresses(F, trial.responses, operators_));
  next.lacking = free_part(internal - loads_.external_force(next.x, next.time, next.load_factor));
  return next;
}

/// A vector of all unknowns with zeros where they are prescribed.
Eigen::VectorXd NonlinearSolver::free_part(Eigen::VectorXd values) const {
  for (const int i : prescribed_) values[i] = 0;
  return values;
}

void NonlinearSolver::commit(Equilibrium& trial, double dt) {
  points_.commit();
  reuse_.commit();
  lagging_.commit();
  StepStart next = end_of(trial, dt);
  last_ = {span(dt), trial.x - committed_.x, trial.multipliers - committed_.multipliers,
           trial.external - committed_.external, trial.load_factor - committed_.load_factor};
  committed_ = std::move(trial);
  const Eigen::VectorXd end = next.x;
  formulation_.commit(next.x);
  committed_.x += next.x - end;  // unknowns that are increments of a step are counted from the new start
  start_ = std::move(next);
}

void NonlinearSolver::complete_reports() { femxdem::complete_reports(points_, committed_.responses); }

void NonlinearSolver::save(NamedArrays& arrays) const {
  formulation_.save(arrays);
  operators_.save(arrays);
  reuse_.save(arrays);
  if (learns_ends(parameters_)) contraction_.save(arrays);
  lagging_.save(arrays);
  arrays.emplace_back("solver.time", std::vector<double>{committed_.time, last_.dt, committed_.load_factor,
                                                         last_.load_factor, start_.time, start_.load_factor});
  add(arrays, "solver.x", committed_.x);
  add(arrays, "solver.multipliers", committed_.multipliers);
  add(arrays, "solver.last_change", last_.x);
  add(arrays, "solver.last_multiplier_change", last_.multipliers);
  add(arrays, "solver.last_external_change", last_.external);
  add(arrays, "solver.internal", committed_.internal);
  add(arrays, "solver.leaving", committed_.leaving);
  add(arrays, "solver.lacking", start_.lacking);
  add(arrays, "solver.start_multipliers", start_.multipliers);
  std::vector<double> answers;
  for (const Response& r : committed_.responses) {
    answers.insert(answers.end(), r.stress.data(), r.stress.data() + 9);
    answers.insert(answers.end(), r.stiffness.data(), r.stiffness.data() + 81);
    answers.insert(answers.end(), r.report.values.begin(), r.report.values.end());
  }
  arrays.emplace_back("solver.responses", std::move(answers));
}

void NonlinearSolver::load(const NamedArrays& arrays) {
  formulation_.load(arrays);
  operators_.load(arrays);
  reuse_.load(arrays);
  if (learns_ends(parameters_)) contraction_.load(arrays);
  lagging_.load(arrays);
  const auto& time = find_array(arrays, "solver.time");
  committed_.time = time.at(0);
  committed_.load_factor = time.at(2);
  start_ = {time.at(4), formulation_.start(), find_vector(arrays, "solver.start_multipliers"), time.at(5),
            find_vector(arrays, "solver.lacking")};
  committed_.x = find_vector(arrays, "solver.x");
  committed_.multipliers = find_vector(arrays, "solver.multipliers");
  last_ = {time.at(1), find_vector(arrays, "solver.last_change"), find_vector(arrays, "solver.last_multiplier_change"),
           find_vector(arrays, "solver.last_external_change"), time.at(3)};
  committed_.leaving = find_vector(arrays, "solver.leaving");
  committed_.F = formulation_.deformation(committed_.x);
  const double* value = find_array(arrays, "solver.responses").data();
  for (Response& r : committed_.responses) {
    std::copy_n(value, 9, r.stress.data());
    std::copy_n(value + 9, 81, r.stiffness.data());
    std::copy_n(value + 90, r.report.values.size(), r.report.values.begin());
    value += 90 + r.report.values.size();
  }
  committed_.internal = find_vector(arrays, "solver.internal");
  committed_.external = loads_.external_force(committed_.x, committed_.time, committed_.load_factor);
}

}  // namespace femxdem
