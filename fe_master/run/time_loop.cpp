#include "time_loop.hpp"

#include <fmt/format.h>

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
  TimeLoop(Problem& problem, MaterialPoints& points, const RunOptions& options, Checkpoint resumed);
  int go();

 private:
  int advance();
  void step();
  std::vector<IterationRecord> note_attempt(const StepResult& result);
  void reject(double time, const std::vector<IterationRecord>& table);
  void accept(Equilibrium start, const std::vector<IterationRecord>& table);
  void restart();
  void write_fields();
  void write_state();
  std::string place(std::size_t point) const;
  bool reuses() const { return case_.solver.reuse_below > 0; }
  std::vector<std::string> columns() const;
  std::string reuse_account() const;

  Problem& problem_;
  const Case& case_;
  const RunOptions& options_;
  MaterialPoints& points_;
  Checkpoint resumed_;
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
  int last_checkpoint_ = 0;  // step of the one on the disk, 0: none
  double whole_time_ = 0;    // of the last step of which every file has what it should
};

TimeLoop::TimeLoop(Problem& problem, MaterialPoints& points, const RunOptions& options, Checkpoint resumed)
    : problem_(problem),
      case_(problem.parameters()),
      options_(options),
      points_(points),
      resumed_(std::move(resumed)),
      files_(case_, options),
      solver_(problem.start(points)),
      control_(case_.control, problem.formulation()),
      results_(options.folder, problem.mesh(), point_positions(problem.formulation()), options.existing, resumed_.step),
      size_(
          {case_.control.step, case_.control.min_step, case_.control.max_step, case_.control.growth, case_.control.cut},
          case_.control.end_time) {
  files_.begin_history(columns(), resumed_.step);
}

int TimeLoop::go() {
  files_.log.say(fmt::format("{}: {} elements, {} material points, {} unknowns, {} rank{}", case_.file,
                             problem_.mesh().elements.size(), points_.size(), problem_.formulation().unknowns(),
                             options_.ranks, options_.ranks > 1 ? "s" : ""));
  for (const std::string& warning : warnings(case_, problem_.mesh())) files_.log.say("warning: " + warning);
  before_ = solver_.committed();
  if (options_.existing == Existing::resume) {
    restart();
  } else {
    files_.log.say(fmt::format("start: out-of-balance force {:.1e} of the loads", solver_.relative_residual(before_)));
  }
  try {
    if (options_.existing != Existing::resume) write_fields();
    const int status = advance();
    const double time = solver_.time();
    const std::string message =
        status == kDone ? fmt::format("{} steps to time {:g}{}", files_.summary.steps, time, reuse_account())
                        : fmt::format("stopped after step {} (time {:g}), all steps up to it are in {}: {}",
                                      files_.summary.steps, time, options_.folder.string(), last_.reason);
    return files_.finish(status, message);
  } catch (const DiskError& error) {
    throw DiskError(files_.stopped_by_the_disk(error.what(), whole_time_));
  } catch (const std::exception& error) {
    files_.finish(kPointFailed, error.what());
    throw;
  }
}

int TimeLoop::advance() {
  int status = kDone;
  while (status == kDone && !size_.done(solver_.time())) {
    step();
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
  if (last_.converged) {
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
  if (reuses()) {
    record_.monitors.push_back(static_cast<double>(reuse_of_step_.answers));
    record_.monitors.push_back(reuse_of_step_.error);
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
  const int checkpoint_every = case_.output.checkpoint_every;
  if (checkpoint_every > 0 && files_.summary.steps % checkpoint_every == 0) write_state();
  files_.whole(last_checkpoint_);
  whole_time_ = now.time;
}

/// Of history.csv, beside those of every run.
std::vector<std::string> TimeLoop::columns() const {
  std::vector<std::string> names = monitor_names(case_);
  if (reuses()) names.insert(names.end(), {"reused", "reuse_error"});
  return names;
}

/// What learned tangents have spared the points, and what it may have cost.
std::string TimeLoop::reuse_account() const {
  if (!reuses()) return "";
  const double answers = static_cast<double>(files_.summary.evaluations) * static_cast<double>(points_.size());
  return fmt::format("; {:.1f} % of the answers from learned tangents, their error at most {:.1e} of the forces",
                     100 * static_cast<double>(reuse_.answers) / answers, reuse_.error);
}

std::string TimeLoop::place(std::size_t point) const {
  const Point2& X = problem_.formulation().shapes(point).X;
  return fmt::format("material point {} (element {}, at {:.4g}, {:.4g} m)", point, point / kPointsPerElement, X.x(),
                     X.y());
}

void TimeLoop::write_fields() {
  results_.write(field_step(files_.summary.steps, case_.control.end_time, problem_, before_));
}

void TimeLoop::write_state() {
  Checkpoint checkpoint{files_.summary.steps,     solver_.time(),    size_.size(),          {}, {},
                        files_.summary.case_hash, options_.versions, comparable_toml(case_)};
  solver_.save(checkpoint.arrays);
  control_.save(checkpoint.arrays);
  checkpoint.arrays.emplace_back(
      "run.counts", std::vector<double>{static_cast<double>(files_.summary.evaluations), files_.summary.dem_steps});
  if (reuses())
    checkpoint.arrays.emplace_back("run.reuse", std::vector<double>{static_cast<double>(reuse_.answers), reuse_.error});
  checkpoint.states = points_.save();
  write_checkpoint(options_.folder / "checkpoint.h5", checkpoint);
  last_checkpoint_ = files_.summary.steps;
  files_.log.note(fmt::format("checkpoint after step {}", files_.summary.steps));
  if (const std::string done = options_.at_checkpoint(); !done.empty()) files_.log.note(done);
}

void TimeLoop::restart() {
  points_.load(resumed_.states);
  solver_.load(resumed_.arrays);
  control_.load(resumed_.arrays);
  before_ = solver_.committed();
  size_.set_size(resumed_.dt);
  files_.summary.steps = last_checkpoint_ = resumed_.step;
  whole_time_ = resumed_.time;
  files_.whole(last_checkpoint_);
  files_.summary.evaluations = static_cast<long>(find_array(resumed_.arrays, "run.counts").at(0));
  files_.summary.dem_steps = find_array(resumed_.arrays, "run.counts").at(1);
  if (reuses()) {
    const auto& reuse = find_array(resumed_.arrays, "run.reuse");
    reuse_ = {static_cast<long>(reuse.at(0)), reuse.at(1)};
  }
  files_.log.start_from(resumed_.time / case_.control.end_time);
  files_.log.say(fmt::format("restart after step {} (time {:g})", resumed_.step, resumed_.time));
  resumed_ = {};
}

}  // namespace

int run_case(Problem& problem, MaterialPoints& points, const RunOptions& options) {
  RunOptions locked = options;
  if (!locked.lock) locked.lock = prepare_output_folder(options.folder, options.existing);
  Checkpoint resumed;
  if (options.existing == Existing::resume) {
    const std::filesystem::path file = options.folder / "checkpoint.h5";
    resumed = read_checkpoint(file, hash_of_restart(file, problem.parameters()), options.versions);
  }
  std::optional<TimeLoop> loop;
  try {
    loop.emplace(problem, points, locked, std::move(resumed));
  } catch (const DiskError& error) {
    throw DiskError(fmt::format("{}; no step has been made; make room and start again", error.what()));
  }
  return loop->go();
}

}  // namespace femxdem
