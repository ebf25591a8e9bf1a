#include "simulation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>

#include "analytic_points.hpp"
#include "checkpoint.hpp"
#include "errors.hpp"
#include "history.hpp"
#include "log.hpp"
#include "monitors.hpp"
#include "point_fields.hpp"
#include "restart.hpp"
#include "results.hpp"
#include "second_gradient_q8.hpp"
#include "solve_step.hpp"
#include "warnings.hpp"

namespace femxdem {
namespace {

constexpr double kTimeRoundOff = 1e-9;  // of the end time: a step that would leave less goes to the end

/// The time loop of one run and the files that it fills.
class Run {
 public:
  Run(const Case& c, const Mesh& mesh, MaterialPoints& points, const RunOptions& options);
  int go();

 private:
  int advance();
  bool step();
  void restart();
  void write_fields();
  void write_state();
  void finish(int status, const std::string& message);
  std::string stopped_by_the_disk(const std::string& reason);
  std::string place(std::size_t point) const;
  double wall() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

  const Case& case_;
  const RunOptions& options_;
  MaterialPoints& points_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::shared_ptr<FolderLock> lock_;  // of the folder, before any file in it
  Checkpoint resumed_;
  Log log_;
  std::unique_ptr<Element> element_;
  Loads loads_;
  StepControl control_;
  NonlinearSolver solver_;
  History history_;
  Results results_;
  Equilibrium before_;  // the committed state before the last step
  double dt_;
  Summary summary_;
  StepRecord record_;  // of the step under way, rejected attempts included
  StepResult last_;
  int last_checkpoint_ = 0;  ///< step of the one on the disk, 0: none
  int whole_step_ = 0;       ///< the last one of which every file has what it should
  double whole_time_ = 0;
};

/// A step that would leave less than half of itself is half of what is left: a tiny last step is a hold for the volume
/// elements, whose stress relaxes in it.
double without_crumb(double dt, double left) { return left < 1.5 * dt ? 0.5 * left : dt; }

std::shared_ptr<FolderLock> prepare(const RunOptions& options) {
  return options.lock ? options.lock : prepare_output_folder(options.folder, options.existing);
}

std::vector<Point2> positions(const Element& element) {
  std::vector<Point2> X;
  for (std::size_t p = 0; p < element.points(); ++p) X.push_back(element.shapes(p).X);
  return X;
}

Checkpoint find_checkpoint(const Case& c, const RunOptions& options) {
  if (options.existing != Existing::resume) return {};
  const std::filesystem::path file = options.folder / "checkpoint.h5";
  return read_checkpoint(file, hash_of_restart(file, c), options.versions);
}

Run::Run(const Case& c, const Mesh& mesh, MaterialPoints& points, const RunOptions& options)
    : case_(c),
      options_(options),
      points_(points),
      lock_(prepare(options)),
      resumed_(find_checkpoint(c, options)),
      log_(options.folder / "log.txt", options.existing),
      element_(make_element(c, mesh)),
      loads_(c, *element_),
      control_(c.control, mesh),
      solver_(*element_, points, loads_,
              with_default_tolerances(c.solver, c.material.type == MaterialType::volume_element)),
      history_(options.folder / "history.csv", monitor_names(c), options.existing, resumed_.step),
      results_(options.folder, mesh, positions(*element_), options.existing, resumed_.step),
      dt_(c.control.step) {
  replace_file(options.folder / "case.toml", effective_toml(c));
  if (auto* second_gradient = dynamic_cast<SecondGradientQ8*>(element_.get())) {
    const Tensor4& C = solver_.committed().responses.front().stiffness;
    second_gradient->set_penalty(c.solver.penalty * C(pair(0, 0), pair(0, 0)));
  }
  summary_.ranks = options.ranks;
  summary_.case_hash = case_hash(c);
  summary_.command_line = options.command_line;
  summary_.versions = options.versions;
}

int Run::go() {
  log_.say(fmt::format("{}: {} elements, {} material points, {} unknowns, {} rank{}", case_.file,
                       element_->mesh().elements.size(), points_.size(), element_->unknowns(), options_.ranks,
                       options_.ranks > 1 ? "s" : ""));
  for (const std::string& warning : warnings(case_, element_->mesh())) log_.say("warning: " + warning);
  if (!lock_->remark().empty()) log_.say(lock_->remark());
  for (const std::string& remark : options_.remarks) log_.note(remark);
  before_ = solver_.committed();
  if (options_.existing == Existing::resume) {
    restart();
  } else {
    log_.say(fmt::format("start: out-of-balance force {:.1e} of the loads", solver_.relative_residual(before_)));
  }
  int status = kNotConverged;
  std::string message;
  try {
    if (options_.existing != Existing::resume) write_fields();
    status = advance();
    message = status == kDone
                  ? fmt::format("{} steps to time {:g}", summary_.steps, solver_.committed().time)
                  : fmt::format("stopped after step {} (time {:g}), all steps up to it are in {}: {}", summary_.steps,
                                solver_.committed().time, options_.folder.string(), last_.reason);
  } catch (const DiskError& error) {
    throw DiskError(stopped_by_the_disk(error.what()));
  } catch (const std::exception& error) {
    finish(kPointFailed, error.what());
    throw;
  }
  finish(status, message);
  return status;
}

/// Says what is whole; the summary of how the run ended is written if it still finds a place.
std::string Run::stopped_by_the_disk(const std::string& reason) {
  const std::string state = last_checkpoint_ > 0
                                ? fmt::format("--restart goes on from the checkpoint after step {}", last_checkpoint_)
                                : "there is no checkpoint to restart from";
  const std::string message = fmt::format("{}; the last whole step is {} (time {:g}), {}; make room and start again",
                                          reason, whole_step_, whole_time_, state);
  try {
    finish(kNotWritten, message);
  } catch (const DiskError&) {  // the same disk
  }
  return message;
}

int Run::advance() {
  const double end = case_.control.end_time;
  int status = kDone;
  while (status == kDone && solver_.committed().time < end * (1 - kTimeRoundOff)) {
    if (!step() && dt_ < case_.control.min_step) status = last_.failure ? kPointFailed : kNotConverged;
  }
  if (summary_.steps % case_.output.every != 0) write_fields();
  return status;
}

/// One attempt; on success everything about it is on the disk.
bool Run::step() {
  const double end = case_.control.end_time, time = solver_.committed().time;
  const bool to_the_end = time + dt_ > end * (1 - kTimeRoundOff);
  const double dt = to_the_end ? end - time : without_crumb(dt_, end - time);
  Equilibrium start = solver_.committed();
  last_ = solver_.solve_step(dt, control_.target(start, dt));
  record_.evaluations += last_.evaluations;
  record_.dem_steps += last_.dem_steps;
  std::vector<IterationRecord> table;
  for (const Iteration& i : last_.table) {
    record_.dem_seconds += i.engine_seconds;
    summary_.evaluate_seconds += i.evaluate_seconds;
    table.push_back({static_cast<int>(table.size()) + 1, i.residual, i.correction, i.longest_point,
                     i.engine_seconds / static_cast<double>(points_.size()), i.solve_seconds, i.element, i.note});
  }
  if (!last_.converged) {
    const bool passes_on = control_.rejected();
    dt_ = passes_on ? dt : dt * case_.control.cut;
    const std::string next = passes_on                      ? "; again, driven by the " + control_.description()
                             : dt_ < case_.control.min_step ? ""
                                                            : fmt::format("; again with a step of {:.3g}", dt_);
    log_.say(fmt::format("step {} to time {:.6g} rejected: {}{}", summary_.steps + 1, time + dt, last_.reason, next));
    for (const IterationRecord& i : table) {
      log_.note(fmt::format("  {:3} |r|/|f| {:.2e} |du|/|u| {:.2e} element {} {}", i.iteration, i.residual,
                            i.correction, i.element, i.note));
    }
    if (last_.failure) log_.say(fmt::format("  {}: {}", place(last_.failure->point), last_.failure->advice));
    return false;
  }
  if (control_.accepted(start, solver_.committed()))
    log_.say(fmt::format("limit point near: the load factor is now found by the {}", control_.description()));
  before_ = std::move(start);
  const Equilibrium& now = solver_.committed();
  record_.step = summary_.steps + 1;
  record_.time = now.time;
  record_.load_factor = case_.control.mode == ControlMode::time ? now.time / end : now.load_factor;
  record_.iterations = last_.iterations();
  record_.residual = last_.table.back().residual;
  record_.wall_seconds = wall();
  record_.monitors = monitor_values(case_, *element_, now);
  history_.add(record_);
  log_.step(record_, table, now.time / end);
  if (last_.best_accepted)
    log_.say(fmt::format("step {} accepted above the tolerance: residual {:.1e}", record_.step, record_.residual));
  summary_.evaluations += record_.evaluations;
  summary_.dem_steps += record_.dem_steps;
  summary_.engine_seconds += record_.dem_seconds;
  const bool quick = last_.iterations() <= case_.control.max_iterations_to_grow;
  if (quick && !to_the_end) dt_ = std::min(dt * case_.control.growth, case_.control.max_step);
  const int step = record_.step;
  record_ = {};
  summary_.steps = step;
  if (step % case_.output.every == 0) write_fields();
  whole_step_ = step;
  whole_time_ = solver_.committed().time;
  if (case_.output.checkpoint_every > 0 && step % case_.output.checkpoint_every == 0) write_state();
  return true;
}

std::string Run::place(std::size_t point) const {
  const Point2& X = element_->shapes(point).X;
  return fmt::format("material point {} (element {}, at {:.4g}, {:.4g} m)", point, point / kPointsPerElement, X.x(),
                     X.y());
}

void Run::write_fields() {
  const Equilibrium& now = solver_.committed();
  const Mesh& mesh = element_->mesh();
  std::vector<Tensor2> stress, stress_before;
  std::vector<PointReport> reports;
  for (const Response& r : now.responses) {
    stress.push_back(r.stress);
    reports.push_back(r.report);
  }
  for (const Response& r : before_.responses) stress_before.push_back(r.stress);
  FieldStep fields{
      summary_.steps, now.time, now.time / case_.control.end_time, {}, point_fields(now.F, stress, reports)};
  fields.point_fields.push_back(second_order_work(before_.F, stress_before, now.F, stress));
  fields.point_fields.push_back({"least_tangent_eigenvalue", 1, solver_.operators().least_eigenvalues()});
  if (auto values = solver_.operators().acoustic_determinants(now.F, now.responses); !values.empty())
    fields.point_fields.push_back({"acoustic_determinant", 1, std::move(values)});
  Field element_residual{"element_residual", 1, {}};
  for (const double value : solver_.element_residuals(now))
    element_residual.values.insert(element_residual.values.end(), kPointsPerElement, value);
  fields.point_fields.push_back(std::move(element_residual));
  Field displacement{"displacement", 2, {}};
  Field residual{"residual", 2, {}};
  Eigen::VectorXd out_of_balance = now.external - now.internal;
  for (const int dof : loads_.prescribed_dofs()) out_of_balance[dof] = 0;  // reactions
  for (std::size_t i = 0; i < 2 * mesh.nodes.size(); ++i) {
    displacement.values.push_back(now.x[static_cast<Eigen::Index>(i)]);
    residual.values.push_back(out_of_balance[static_cast<Eigen::Index>(i)]);
  }
  fields.node_fields = {displacement, residual};
  if (const auto* second_gradient = dynamic_cast<const SecondGradientQ8*>(element_.get())) {
    Field v{"micro_gradient", 4, {}}, double_stress{"double_stress", 8, {}};
    for (std::size_t n = 0; n < mesh.nodes.size(); ++n) {
      const Eigen::Vector4d value = second_gradient->micro_gradient(static_cast<int>(n));
      v.values.insert(v.values.end(), value.data(), value.data() + 4);
    }
    for (std::size_t p = 0; p < element_->points(); ++p) {
      const DoubleStress& value = second_gradient->double_stress(p);
      double_stress.values.insert(double_stress.values.end(), value.data(), value.data() + 8);
    }
    fields.node_fields.push_back(std::move(v));
    fields.point_fields.push_back(std::move(double_stress));
  }
  results_.write(fields);
}

void Run::write_state() {
  Checkpoint checkpoint{summary_.steps,    solver_.committed().time, dt_, {}, {}, summary_.case_hash,
                        options_.versions, comparable_toml(case_)};
  solver_.save(checkpoint.arrays);
  control_.save(checkpoint.arrays);
  checkpoint.arrays.emplace_back("run.counts",
                                 std::vector<double>{static_cast<double>(summary_.evaluations), summary_.dem_steps});
  checkpoint.states = points_.save();
  write_checkpoint(options_.folder / "checkpoint.h5", checkpoint);
  last_checkpoint_ = summary_.steps;
  log_.note(fmt::format("checkpoint after step {}", summary_.steps));
}

void Run::restart() {
  points_.load(resumed_.states);
  solver_.load(resumed_.arrays);
  control_.load(resumed_.arrays);
  before_ = solver_.committed();
  dt_ = resumed_.dt;
  last_checkpoint_ = whole_step_ = resumed_.step;
  whole_time_ = resumed_.time;
  summary_.steps = resumed_.step;
  summary_.evaluations = static_cast<long>(resumed_.array("run.counts").at(0));
  summary_.dem_steps = resumed_.array("run.counts").at(1);
  log_.start_from(resumed_.time / case_.control.end_time);
  log_.say(fmt::format("restart after step {} (time {:g})", resumed_.step, resumed_.time));
  resumed_ = {};
}

void Run::finish(int status, const std::string& message) {
  summary_.status = status == kDone ? "done" : status == kNotConverged ? "not converged" : "failed";
  summary_.message = message;
  summary_.exit_status = status;
  summary_.wall_seconds = wall();
  summary_.peak_memory_master = peak_memory();
  options_.complete(summary_);
  write_summary(options_.folder / "summary.json", summary_);
  log_.say(fmt::format("{}: {}", summary_.status, message));
}

}  // namespace

std::unique_ptr<Element> make_element(const Case& c, const Mesh& mesh) {
  if (c.element.type == ElementType::q8) return std::make_unique<Element>(mesh);
  return std::make_unique<SecondGradientQ8>(mesh, make_double_stiffness(c.element), 0.0);
}

DoubleStiffness make_double_stiffness(const ElementParameters& e) {
  if (e.mindlin.empty()) return one_parameter_law(e.D);
  std::array<double, 5> a{};
  std::copy_n(e.mindlin.begin(), 5, a.begin());
  return mindlin_law(a);
}

AnalyticLaw make_law(const MaterialParameters& m) {
  constexpr double degree = std::numbers::pi / 180;
  switch (m.type) {
    case MaterialType::jaumann:
      return JaumannLaw{m.young, m.poisson, m.initial_pressure};
    case MaterialType::von_mises:
      return VonMisesLaw{m.young, m.poisson, m.yield_stress, m.hardening, m.residual_stress, m.initial_pressure};
    case MaterialType::drucker_prager:
      return DruckerPragerLaw{
          m.young,     m.poisson,         m.cohesion,        m.friction_angle * degree, m.dilatancy_angle * degree,
          m.hardening, m.residual_stress, m.initial_pressure};
    case MaterialType::bilinear:
      return BilinearLaw{m.A1, m.A2, m.limit_strain, m.residual_stress, 0};
    default:
      return ElasticLaw{m.young, m.poisson, m.initial_pressure};
  }
}

std::unique_ptr<MaterialPoints> make_analytic_points(const Case& c, const Mesh& mesh) {
  std::vector<AnalyticLaw> laws;
  for (const MaterialParameters& m : material_of_element(c, mesh))
    laws.insert(laws.end(), kPointsPerElement, make_law(m));
  return std::make_unique<AnalyticPoints>(std::move(laws));
}

int run_simulation(const Case& c, const Mesh& mesh, MaterialPoints& points, const RunOptions& options) {
  std::unique_ptr<Run> run;
  try {
    run = std::make_unique<Run>(c, mesh, points, options);
  } catch (const DiskError& error) {
    throw DiskError(fmt::format("{}; no step has been made; make room and start again", error.what()));
  }
  return run->go();
}

}  // namespace femxdem
