#include "path.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "analytic_points.hpp"
#include "checkpoint.hpp"
#include "end_request.hpp"
#include "errors.hpp"
#include "path_driver.hpp"
#include "problem.hpp"
#include "restart.hpp"
#include "step_size.hpp"

namespace femxdem {
namespace {

constexpr double kStrainIncrement = 1e-3;   // of the default path
constexpr double kSmallestFraction = 1e-3;  // of a segment's increment: below it the path ends
const std::array<std::string_view, 3> kLeftOut = {"dem_steps", "seconds", "engine_seconds"};  // of the report

std::vector<std::string> columns(bool with_noise) {
  std::vector<std::string> names;
  for (const char* quantity : {"strain", "stress"}) {
    for (const char* component : kPathComponents) names.push_back(fmt::format("{}_{}", quantity, component));
  }
  for (int i = 1; i <= 3; ++i) {
    for (int j = 1; j <= 3; ++j) names.push_back(fmt::format("F_{}{}", i, j));
  }
  for (const std::string_view field : kReportFields) {
    if (std::find(kLeftOut.begin(), kLeftOut.end(), field) == kLeftOut.end()) names.emplace_back(field);
  }
  if (with_noise) names.emplace_back("stress_noise");
  return names;
}

std::vector<double> values(const Tensor2& F, const Response& response) {
  const PathVector strain = path_strain(F), stress = path_components(response.stress);
  std::vector<double> row(strain.begin(), strain.end());
  row.insert(row.end(), stress.begin(), stress.end());
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) row.push_back(F(i, j));
  }
  for (const std::string_view field : kReportFields) {
    if (std::find(kLeftOut.begin(), kLeftOut.end(), field) == kLeftOut.end()) row.push_back(response.report[field]);
  }
  return row;
}

/// The steps along the segments and the files that they fill.
class Path {
 public:
  Path(const Case& c, MaterialPoints& point, const RunOptions& options, int noise_samples);
  int go();

 private:
  enum class End { done, failed, told_to };
  End segment(std::size_t number);
  void resume();
  bool told_to_end();
  void save(std::size_t segment, double done, double size);
  bool step(double fraction, double segments_before);
  void record_row();

  const Case& case_;
  MaterialPoints& point_;
  const RunOptions& options_;
  int noise_samples_;
  SolverParameters parameters_;
  PathDriver driver_;
  RunFiles files_;
  StepRecord record_;  // of the step under way, rejected attempts included
  PathStep last_;
  double last_noise_ = 0, largest_noise_ = 0;
  EndRequest end_request_;
  std::string end_reason_;
  std::optional<Checkpoint> resumed_;  // until its segment is taken up
};

Path::Path(const Case& c, MaterialPoints& point, const RunOptions& options, int noise_samples)
    : case_(c),
      point_(point),
      options_(options),
      noise_samples_(noise_samples),
      parameters_(solver_parameters(c)),
      driver_(point, parameters_),
      files_(c, options),
      end_request_(options.ends_before) {
  if (Resumed resumed = resumed_from(options, c); resumed.file) {
    resumed_ = std::move(resumed.checkpoint);
    point.load_each(resumed.file->states());
  }
  files_.begin_history(columns(noise_samples > 0), resumed_ ? resumed_->step : 0);
}

int Path::go() {
  files_.log.say(fmt::format("{}: one material point, {} segment{}", case_.file, case_.path.size(),
                             case_.path.size() > 1 ? "s" : ""));
  resumed_ ? resume() : record_row();
  try {
    for (auto s = resumed_ ? static_cast<std::size_t>(resumed_->time) : 0; s < case_.path.size(); ++s) {
      const End end = segment(s);
      if (end == End::done) continue;
      if (end == End::told_to)
        return files_.finish(
            kRunAgain, fmt::format("{}: stopped and saved after step {} in {}; run again with --restart", end_reason_,
                                   files_.summary.steps, options_.folder.string()));
      return files_.finish(
          last_.failure ? kPointFailed : kNotConverged,
          fmt::format("stopped after step {}, {:.3g} % along segment {}, all steps up to it are in {}: {}",
                      files_.summary.steps, 100 * (record_.time - static_cast<double>(s)), s + 1,
                      options_.folder.string(), last_.reason));
    }
  } catch (const DiskError& error) {
    throw DiskError(
        fmt::format("{}; the last whole step is {}; make room and start again", error.what(), files_.summary.steps));
  } catch (const std::exception& error) {
    files_.finish(kPointFailed, error.what());
    throw;
  }
  const std::string noise = noise_samples_ > 0 ? fmt::format(
                                                     "; stress noise at most {:.1e} of |stress| at strains "
                                                     "within {:.0e}, tolerance {:.1e}",
                                                     largest_noise_, parameters_.qn_noise, parameters_.tolerance)
                                               : "";
  return files_.finish(
      kDone, fmt::format("{} steps, {} evaluations{}", files_.summary.steps, files_.summary.evaluations, noise));
}

void Path::resume() {
  files_.load(resumed_->step, resumed_->arrays);
  files_.log.start_from(resumed_->time / static_cast<double>(case_.path.size()));
  files_.log.say(fmt::format("restart after step {}", resumed_->step));
}

bool Path::told_to_end() {
  constexpr double kNeeded = 5;  // for a step and the checkpoint [s]
  end_reason_ = end_request_.reason(kNeeded).value_or("");
  return !end_reason_.empty();
}

/// time: the number of the segment.
void Path::save(std::size_t segment, double done, double size) {
  Checkpoint checkpoint{files_.summary.steps, static_cast<double>(segment), size, {}, comparable_toml(case_),
                        options_.versions};
  driver_.save(checkpoint.arrays);
  checkpoint.arrays.emplace_back("path.done", std::vector<double>{done});
  files_.save(checkpoint.arrays);
  write_checkpoint(checkpoint_of(options_.folder), checkpoint, point_);
}

/// Increments of one segment, cut where they fail, until the smallest one fails too or it is told to end.
Path::End Path::segment(std::size_t number) {
  const double increment = 1.0 / case_.path[number].increments;
  StepSize size({increment, kSmallestFraction * increment, increment, case_.control.growth, case_.control.cut}, 1);
  double done = 0;
  if (resumed_) {
    done = find_array(resumed_->arrays, "path.done").at(0);
    size.set_size(resumed_->dt);
    driver_.load(resumed_->arrays, case_.path[number]);
    resumed_.reset();
  } else {
    driver_.begin_segment(case_.path[number]);
  }
  while (!size.done(done)) {
    if (record_.evaluations == 0 && told_to_end()) {
      save(number, done, size.size());
      return End::told_to;
    }
    const double next = done + size.next(done);
    if (step(next, static_cast<double>(number))) {
      done = next;
      size.accepted(true);
      continue;
    }
    size.rejected();
    files_.log.say(fmt::format("step {} rejected: {}", files_.summary.steps + 1, last_.reason));
    record_.time = static_cast<double>(number) + done;
    if (size.exhausted()) return End::failed;
  }
  return End::done;
}

/// A step to `fraction` of a segment; its row is of the moment that the answer belongs to.
bool Path::step(double fraction, double segments_before) {
  last_ = driver_.solve(fraction);
  std::vector<IterationRecord> table;
  for (const PathIteration& i : last_.table) {
    table.push_back(
        {static_cast<int>(table.size()) + 1, i.residual, i.correction, i.engine_seconds, i.engine_seconds, 0, 0, ""});
    record_.dem_steps += i.dem_steps;
    record_.dem_seconds += i.engine_seconds;
    files_.summary.evaluate_seconds += i.seconds;
    files_.summary.trial_seconds += i.seconds;
  }
  record_.evaluations += static_cast<int>(table.size());
  if (!last_.converged) return false;
  if (noise_samples_ > 0) last_noise_ = driver_.noise(parameters_.qn_noise, noise_samples_);
  largest_noise_ = std::max(largest_noise_, last_noise_);
  driver_.commit();
  const double time = segments_before + driver_.fraction();
  record_.time = time;
  record_.load_factor = time / static_cast<double>(case_.path.size());
  record_.iterations = static_cast<int>(table.size());
  record_.histories = 1;
  record_.residual = last_.table.back().residual;
  record_.step = ++files_.summary.steps;
  const StepRecord row = record_;
  record_row();
  files_.log.step(row, table, row.load_factor);
  return true;
}

/// The committed state as a row of history.csv, and into the sums.
void Path::record_row() {
  record_.wall_seconds = files_.wall();
  record_.monitors = values(driver_.F(), driver_.response());
  if (noise_samples_ > 0) record_.monitors.push_back(last_noise_);
  files_.add(record_);
  record_ = {};
}

/// Largest shortening (or lengthening) that the loads prescribe along y at the end, over the rectangle's height.
double axial_strain(const Case& c) {
  double strain = 0;
  for (const Load& load : c.loads) {
    const bool moves = load.kind == LoadKind::displacement || load.kind == LoadKind::velocity;
    if (!moves || load.component != Component::y || c.mesh.type != MeshType::rectangle) continue;
    const double e = load.value * load_factor(load, c.control.end_time, c.control.end_time) / c.mesh.height;
    if (std::abs(e) > std::abs(strain) && e > -1) strain = e;
  }
  return strain != 0 ? std::log1p(strain) : std::log(0.95);
}

double lateral_pressure(const Case& c) {
  for (const Load& load : c.loads) {
    if (load.kind == LoadKind::pressure) return load.value;
  }
  return on_volume_elements(c) ? c.ve.confining_stress : c.material.initial_pressure;
}

}  // namespace

PathSegment biaxial_path(const Case& c) {
  PathSegment segment;
  segment.stress[0] = -lateral_pressure(c);
  segment.strain[1] = axial_strain(c);
  segment.increments = std::max(1, static_cast<int>(std::lround(std::abs(segment.strain[1]) / kStrainIncrement)));
  return segment;
}

Case read_path_case(const std::string& file, const std::vector<std::string>& overrides) {
  try {
    return read_case(file, overrides, Purpose::ve_path);
  } catch (const UserError&) {
    // Perhaps nothing is wrong but that a boundary value problem has no path.
    Case c;
    try {
      c = read_case(file, overrides, Purpose::ve_of_run);
    } catch (const UserError&) {
    }
    if (c.file.empty() || !c.path.empty()) throw;
    c.path = {biaxial_path(c)};
    return c;
  }
}

std::unique_ptr<MaterialPoints> make_analytic_point(const Case& c) {
  return std::make_unique<AnalyticPoints>(std::vector<AnalyticLaw>{make_law(c.material)});
}

int follow_path(const Case& c, MaterialPoints& point, const RunOptions& options, int noise_samples) {
  return Path(c, point, options, noise_samples).go();
}

}  // namespace femxdem
