#include "time_loop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>

#include "checkpoint.hpp"
#include "field_output.hpp"
#include "monitors.hpp"
#include "restart.hpp"
#include "step_size.hpp"
#include "warnings.hpp"

namespace femxdem {
namespace {

/// The time loop of one run and the files that it fills.
class TimeLoop {
 public:
  TimeLoop(Problem& problem, MaterialPoints& points, const RunOptions& options, Resumed resumed);
  int go();

 private:
  int advance();
  void step();
  std::vector<IterationRecord> note_attempt(const StepResult& result);
  void reject(double time, const std::vector<IterationRecord>& table);
  void accept(Equilibrium start, const std::vector<IterationRecord>& table);
  void restart();
  void write_fields();
  void keep_state();
  void write_state();
  bool checkpoint_due() const;
  double needed_to_end() const;
  bool told_to_end();
  std::string stopped();
  std::string place(std::size_t point) const;
  std::vector<std::string> columns() const;
  std::string reuse_account() const;
  std::string learned_ends_account() const;

  Problem& problem_;
  const Case& case_;
  const RunOptions& options_;
  MaterialPoints& points_;
  Resumed resumed_;
  RunFiles files_;
  NonlinearSolver& solver_;
  StepControl control_;
  Results results_;
  Equilibrium before_;  // the committed state before the last step
  StepSize size_;
  StepRecord record_;  // of the step under way, rejected attempts included
  StepResult last_;
  struct Reuse {  // ReusedAnswers
    long answers = 0;
    double error = 0;  // largest that was accepted
  } reuse_, reuse_of_step_;
  struct LearnedEnds {  // steps whose last correction was answered by learned tangents
    int steps = 0, raised = 0;
    double tolerance = 0;  // largest that noise has raised it to
  } learned_ends_;
  EndRequest end_request_;
  std::string end_reason_;  // why it is to end now
  Checkpoint state_;        // of the last converged step, without that of the points
  Moment last_saved_ = Moment::clock::now();
  double checkpoint_seconds_ = 0, longest_evaluation_ = 0;  // wall time
};

TimeLoop::TimeLoop(Problem& problem, MaterialPoints& points, const RunOptions& options, Resumed resumed)
    : problem_(problem),
      case_(problem.parameters()),
      options_(options),
      points_(points),
      resumed_(std::move(resumed)),
      files_(case_, options),
      solver_(problem.start(points)),
      control_(case_.control, problem.formulation()),
      results_(options.folder, problem.mesh(), point_positions(problem.formulation()), options.existing,
               resumed_.checkpoint.step),
      size_(
          {case_.control.step, case_.control.min_step, case_.control.max_step, case_.control.growth, case_.control.cut},
          case_.control.end_time),
      end_request_(options.ends_before) {
  solver_.stop_when([this] { return told_to_end(); });
  files_.begin_history(columns(), resumed_.checkpoint.step);
  state_.versions = options_.versions;
  state_.case_text = comparable_toml(case_);
}

int TimeLoop::go() {
  files_.log.say(fmt::format("{}: {} elements, {} material points, {} unknowns, {} rank{}", case_.file,
                             problem_.mesh().elements.size(), points_.size(), problem_.formulation().unknowns(),
                             options_.ranks, options_.ranks > 1 ? "s" : ""));
  for (const std::string& warning : warnings(case_, problem_.mesh())) files_.log.say("warning: " + warning);
  if (const std::string advice = preset_advice(case_, problem_.mesh()); !advice.empty()) files_.log.say(advice);
  before_ = solver_.committed();
  if (options_.existing == Existing::resume) {
    restart();
  } else {
    files_.log.say(fmt::format("start: out-of-balance force {:.1e} of the loads", solver_.relative_residual(before_)));
  }
  if (const auto left = end_request_.seconds_left())
    files_.log.say(
        fmt::format("time limit: saves and ends with status {} within {}", +kRunAgain, readable_duration(*left)));
  try {
    if (options_.existing != Existing::resume) {
      write_fields();
      keep_state();
    }
    const int status = advance();
    const double time = solver_.time();
    const std::string message = status == kDone ? fmt::format("{} steps to time {:g}{}{}", files_.summary.steps, time,
                                                              learned_ends_account(), reuse_account())
                                : status == kRunAgain
                                    ? stopped()
                                    : fmt::format("stopped after step {} (time {:g}), all steps up to it are in {}: {}",
                                                  files_.summary.steps, time, options_.folder.string(), last_.reason);
    return files_.finish(status, message);
  } catch (const DiskError& error) {
    throw DiskError(files_.stopped_by_the_disk(error.what()));
  } catch (const std::exception& error) {
    files_.finish(kPointFailed, error.what());
    throw;
  }
}

int TimeLoop::advance() {
  int status = kDone;
  while (status == kDone && !size_.done(solver_.time())) {
    step();
    if (last_.stopped) return kRunAgain;
    if (!last_.converged && size_.exhausted()) status = last_.failure ? kPointFailed : kNotConverged;
  }
  if (files_.summary.steps % case_.output.every != 0) write_fields();
  return status;
}

/// One attempt; on success everything about it is on the disk.
void TimeLoop::step() {
  Equilibrium start = solver_.committed();
  const double begin = solver_.time(), dt = size_.next(begin);
  last_ = solver_.solve_step(dt, control_.target(start, solver_.span(dt)));
  const std::vector<IterationRecord> table = note_attempt(last_);
  if (last_.stopped) {
    record_ = {};
  } else if (last_.converged) {
    accept(std::move(start), table);
  } else {
    reject(begin + dt, table);
  }
}

std::vector<IterationRecord> TimeLoop::note_attempt(const StepResult& result) {
  record_.evaluations += result.evaluations;
  record_.dem_steps += result.dem_steps;
  reuse_of_step_.answers += result.reused;
  std::vector<IterationRecord> table;
  for (const Iteration& i : result.table) {
    record_.dem_seconds += i.engine_seconds;
    files_.summary.evaluate_seconds += i.evaluate_seconds;
    longest_evaluation_ = std::max(longest_evaluation_, i.evaluate_seconds);
    table.push_back({static_cast<int>(table.size()) + 1, i.residual, i.correction, i.longest_point,
                     i.engine_seconds / static_cast<double>(points_.size()), i.solve_seconds, i.element, i.note});
  }
  return table;
}

void TimeLoop::reject(double time, const std::vector<IterationRecord>& table) {
  const bool passes_on = control_.rejected();
  passes_on ? size_.again() : size_.rejected();
  const std::string next = passes_on           ? "; again, driven by the " + control_.description()
                           : size_.exhausted() ? ""
                                               : fmt::format("; again with a step of {:.3g}", size_.size());
  files_.log.say(
      fmt::format("step {} to time {:.6g} rejected: {}{}", files_.summary.steps + 1, time, last_.reason, next));
  for (const IterationRecord& i : table) {
    files_.log.note(fmt::format("  {:3} |r|/|f| {:.2e} |du|/|u| {:.2e} element {} {}", i.iteration, i.residual,
                                i.correction, i.element, i.note));
  }
  if (last_.failure) files_.log.say(fmt::format("  {}: {}", place(last_.failure->point), last_.failure->advice));
}

void TimeLoop::accept(Equilibrium start, const std::vector<IterationRecord>& table) {
  const Equilibrium& now = solver_.committed();
  if (control_.accepted(start, now))
    files_.log.say(fmt::format("limit point near: the load factor is now found by the {}", control_.description()));
  before_ = std::move(start);
  const double done = solver_.time() / case_.control.end_time;
  record_.step = ++files_.summary.steps;
  record_.time = now.time;
  record_.load_factor = case_.control.mode == ControlMode::time ? now.time / case_.control.end_time : now.load_factor;
  record_.iterations = last_.iterations();
  record_.histories = points_.distinct();
  record_.residual = last_.table.back().residual;
  record_.wall_seconds = files_.wall();
  record_.monitors = monitor_values(case_, problem_.formulation(), now);
  reuse_of_step_.error = last_.table.back().reuse_error;
  if (reuses(case_.solver)) {
    record_.monitors.push_back(static_cast<double>(reuse_of_step_.answers));
    record_.monitors.push_back(reuse_of_step_.error);
  }
  if (learns_ends(case_.solver)) {
    record_.monitors.push_back(last_.tolerance);
    record_.monitors.push_back(last_.learned_at_end);
    learned_ends_.steps += last_.learned_at_end;
    learned_ends_.raised += last_.tolerance > case_.solver.tolerance;
    learned_ends_.tolerance = std::max(learned_ends_.tolerance, last_.tolerance);
  }
  reuse_ = {reuse_.answers + reuse_of_step_.answers, std::max(reuse_.error, reuse_of_step_.error)};
  files_.add(record_);
  files_.log.step(record_, table, done);
  if (last_.best_accepted)
    files_.log.say(
        fmt::format("step {} accepted above the tolerance: residual {:.1e}", record_.step, record_.residual));
  size_.accepted(last_.iterations() <= case_.control.max_iterations_to_grow);
  record_ = {};
  reuse_of_step_ = {};
  if (files_.summary.steps % case_.output.every == 0) write_fields();
  keep_state();
  if (checkpoint_due()) {
    write_state();
    if (const std::string done = options_.at_checkpoint(); !done.empty()) files_.log.note(done);
  }
  files_.whole(now.time);
}

/// Of history.csv, beside those of every run.
std::vector<std::string> TimeLoop::columns() const {
  std::vector<std::string> names = monitor_names(case_);
  for (const std::string& name : columns_of(case_.solver)) names.push_back(name);
  return names;
}

/// What learned tangents have spared the points, and what it may have cost.
std::string TimeLoop::reuse_account() const {
  if (!reuses(case_.solver)) return "";
  const double answers = static_cast<double>(files_.summary.evaluations) * static_cast<double>(points_.size());
  return fmt::format("; {:.1f} % of the answers from learned tangents, their error at most {:.1e} of the forces",
                     100 * static_cast<double>(reuse_.answers) / answers, reuse_.error);
}

/// How many steps have ended without an evaluation of the last correction, and what they were held against.
std::string TimeLoop::learned_ends_account() const {
  if (!learns_ends(case_.solver)) return "";
  const std::string ends = fmt::format("; the last correction of {} of them by learned tangents", learned_ends_.steps);
  if (learned_ends_.raised == 0) return ends;
  return ends + fmt::format(", in {} with the tolerance raised by the residual's noise, at most to {:.1e}",
                            learned_ends_.raised, learned_ends_.tolerance);
}

std::string TimeLoop::place(std::size_t point) const {
  const Point2& X = problem_.formulation().shapes(point).X;
  return fmt::format("material point {} (element {}, at {:.4g}, {:.4g} m)", point, point / kPointsPerElement, X.x(),
                     X.y());
}

void TimeLoop::write_fields() {
  solver_.complete_reports();
  results_.write(field_step(files_.summary.steps, case_.control.end_time, problem_, before_));
}

/// The master's state after a converged step: what a step that is dropped later has learned does not belong to it.
void TimeLoop::keep_state() {
  state_.step = files_.summary.steps;
  state_.time = solver_.time();
  state_.dt = size_.size();
  state_.arrays.clear();
  solver_.save(state_.arrays);
  control_.save(state_.arrays);
  files_.save(state_.arrays);
  if (reuses(case_.solver))
    state_.arrays.emplace_back("run.reuse", std::vector<double>{static_cast<double>(reuse_.answers), reuse_.error});
  if (learns_ends(case_.solver))
    state_.arrays.emplace_back("run.learned_ends",
                               std::vector<double>{static_cast<double>(learned_ends_.steps),
                                                   static_cast<double>(learned_ends_.raised), learned_ends_.tolerance});
}

void TimeLoop::write_state() {
  const auto start = Moment::clock::now();
  const CheckpointSize size = write_checkpoint(checkpoint_of(options_.folder), state_, points_);
  files_.checkpoint_written();
  last_saved_ = Moment::clock::now();
  checkpoint_seconds_ = std::chrono::duration<double>(last_saved_ - start).count();
  const double points = static_cast<double>(points_.size()), bytes = static_cast<double>(size.bytes);
  files_.log.note(
      fmt::format("checkpoint after step {}: {:.3g} s, {:.4g} MB, {} different states; {:.2g} ms and {:.3g} kB a point",
                  state_.step, checkpoint_seconds_, bytes / 1e6, size.states, 1e3 * checkpoint_seconds_ / points,
                  bytes / 1e3 / points));
  files_.summary.checkpoints += 1;
  files_.summary.checkpoint_seconds += checkpoint_seconds_;
  files_.summary.checkpoint_bytes = size.bytes;
}

bool TimeLoop::checkpoint_due() const {
  const OutputParameters& output = case_.output;
  const std::chrono::duration<double, std::ratio<60>> since = Moment::clock::now() - last_saved_;
  return (output.checkpoint_every > 0 && files_.summary.steps % output.checkpoint_every == 0) ||
         (output.checkpoint_minutes > 0 && since.count() >= output.checkpoint_minutes);
}

/// Seconds for one more evaluation and the last checkpoint, with reserves; before the first checkpoint a guess.
double TimeLoop::needed_to_end() const {
  constexpr double kReserve = 5, kGuess = 0.02;  // [s], [s] a point
  const double guess = problem_.on_volume_elements() ? kGuess * static_cast<double>(points_.size()) : 0;
  return 1.5 * longest_evaluation_ + (checkpoint_seconds_ > 0 ? 2 * checkpoint_seconds_ : guess) + kReserve;
}

bool TimeLoop::told_to_end() {
  if (end_reason_.empty()) end_reason_ = end_request_.reason(needed_to_end()).value_or("");
  return !end_reason_.empty();
}

/// Saves, unless it is saved already; the sentence about it.
std::string TimeLoop::stopped() {
  if (files_.last_checkpoint() != state_.step) write_state();
  return fmt::format("{}: stopped and saved after step {} (time {:g}) in {}; run again with --restart", end_reason_,
                     state_.step, solver_.time(), options_.folder.string());
}

void TimeLoop::restart() {
  points_.load_each(resumed_.file->states());
  const Checkpoint& then = resumed_.checkpoint;
  solver_.load(then.arrays);
  control_.load(then.arrays);
  before_ = solver_.committed();
  size_.set_size(then.dt);
  files_.load(then.step, then.arrays);
  files_.checkpoint_written();
  files_.whole(then.time);
  if (reuses(case_.solver)) {
    const auto& reuse = find_array(then.arrays, "run.reuse");
    reuse_ = {static_cast<long>(reuse.at(0)), reuse.at(1)};
  }
  if (learns_ends(case_.solver)) {
    const auto& ends = find_array(then.arrays, "run.learned_ends");
    learned_ends_ = {static_cast<int>(ends.at(0)), static_cast<int>(ends.at(1)), ends.at(2)};
  }
  files_.log.start_from(then.time / case_.control.end_time);
  files_.log.say(fmt::format("restart after step {} (time {:g})", then.step, then.time));
  resumed_ = {};
  keep_state();
}

}  // namespace

int run_case(Problem& problem, MaterialPoints& points, const RunOptions& options) {
  RunOptions locked = options;
  if (!locked.lock) locked.lock = prepare_output_folder(options.folder, options.existing);
  Resumed resumed = resumed_from(options, problem.parameters());
  std::optional<TimeLoop> loop;
  try {
    loop.emplace(problem, points, locked, std::move(resumed));
  } catch (const DiskError& error) {
    throw DiskError(fmt::format("{}; no step has been made; make room and start again", error.what()));
  }
  return loop->go();
}

}  // namespace femxdem
