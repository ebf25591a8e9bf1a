#include "python_volume_elements.hpp"

#include <fmt/format.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <limits>
#include <stdexcept>

#include "compact_cell.hpp"
#include "errors.hpp"
#include "hash.hpp"

namespace femxdem {
PythonVolumeElements::PythonVolumeElements(WorkerProcess& worker, VolumeElementOptions options)
    : worker_(worker), options_(std::move(options)) {}

PythonVolumeElements::Template PythonVolumeElements::make_template(const std::string& specification_json) {
  drop_trial();
  const Reply reply = worker_.request(Command::make_template, 0, 0, specification_json);
  if (reply.kind == ReplyKind::child_died && WIFSIGNALED(reply.value) && WTERMSIG(reply.value) == SIGALRM)
    throw UserError(
        "volume element: its script is within a call that cannot be interrupted, 20 s after ve.script_seconds; let it "
        "end, or give it more time");
  if (reply.kind == ReplyKind::child_died)
    throw UserError(
        fmt::format("volume element: its preparation ended with {} by itself, its output is above; see what its script "
                    "or its contact law does",
                    describe_wait_status(reply.value)));
  const std::string mail = worker_.mail(reply);
  const auto state_size = static_cast<std::size_t>(reply.value);
  return {mail.substr(0, state_size), mail.substr(state_size)};
}

std::string PythonVolumeElements::versions() {
  drop_trial();
  return worker_.mail(worker_.request(Command::versions));
}

void PythonVolumeElements::add(const std::string& state, std::size_t count) {
  if (count == 0) return;
  drop_trial();
  const std::optional<VeState> saved = decode(state);
  if (saved && saved->engine == EngineKind::compact)
    throw UserError("a compact cell's state goes back only into a volume element of the scene that it was made from");
  worker_.request(Command::add, static_cast<std::int64_t>(count), 0, saved ? saved->bytes : state);
  const std::size_t first = size();
  const VeInfo added = worker_.slot(first).info;
  if (!saved) require_time_scale(added.time_scale, added.time_step, added.mean_stress);
  StrainedPoint point;
  point.reference_time_scale = saved ? saved->reference_time_scale : added.time_scale;
  point.origin = saved ? saved->origin : hash(state);
  points_.resize(first + count, point);
  reports_.resize(first + count);
  for (std::size_t i = first; i < size(); ++i) {
    adopt_state(i);
    keep_report(i);
  }
  peak_memory_ = std::max(peak_memory_, worker_.memory());
}

void PythonVolumeElements::remove(std::size_t index) {
  drop_trial();
  worker_.request(Command::remove, static_cast<std::int64_t>(index));
  points_.erase(points_.begin() + static_cast<std::ptrdiff_t>(index));
  reports_.erase(reports_.begin() + static_cast<std::ptrdiff_t>(index));
}

void PythonVolumeElements::begin_step() {
  for (StrainedPoint& point : points_) point.frozen_steps = 0;
}

std::vector<Response> PythonVolumeElements::evaluate(std::span<const Tensor2> F, Operator wanted) {
  require_answerable(wanted, F.size(), size());
  drop_trial();
  std::vector<Response> responses(size());
  if (size() == 0) return responses;
  std::vector<Straining> plans;
  for (std::size_t i = 0; i < size(); ++i) {
    plans.push_back(plan(i, F[i]));
    worker_.slot(i).task = plans[i].refusal ? Task::skip : Task::deform;
    responses[i].failure = plans[i].refusal;
  }
  worker_.be_patient(patience(plans));
  run_trial(wanted == Operator::elastic, responses);
  note_cost(plans);
  for (std::size_t i = 0; i < size(); ++i)
    if (!responses[i].failure) read(i, plans[i], wanted, responses[i]);
  trial_failed_ = std::any_of(responses.begin(), responses.end(), [](const Response& r) { return r.failure; });
  return responses;
}

/// A hundred times what the dearest DEM step so far would take: a process that waits for a processor is no dead one.
double PythonVolumeElements::patience(const std::vector<Straining>& plans) const {
  constexpr double kTimes = 100, kLeast = 60;  // [-], [s]
  if (seconds_per_step_ == 0) return std::numeric_limits<double>::infinity();
  long most = 1;
  for (const Straining& plan : plans) most = std::max(most, plan.steps);
  return std::max(kLeast, kTimes * seconds_per_step_ * static_cast<double>(most));
}

void PythonVolumeElements::note_cost(const std::vector<Straining>& plans) {
  constexpr auto seconds = std::find(kReportFields.begin(), kReportFields.end(), "seconds") - kReportFields.begin();
  for (std::size_t i = 0; i < size(); ++i) {
    const Slot& slot = worker_.slot(i);
    if (slot.task != Task::deform || slot.outcome != Outcome::answered) continue;
    seconds_per_step_ =
        std::max(seconds_per_step_, slot.report[seconds] / static_cast<double>(std::max(plans[i].steps, 1L)));
  }
}

Straining PythonVolumeElements::plan(std::size_t index, const Tensor2& F) {
  Slot& slot = worker_.slot(index);
  const Straining straining = plan_straining(options_, points_[index], slot.info.time_step, index, F);
  slot.steps = straining.steps;
  slot.velocity_gradient = straining.velocity_gradient;
  slot.sample_every = answers_mean(options_) ? sample_every(straining.steps) : 0;
  slot.late = lateness(options_, straining.steps);
  return straining;
}

void PythonVolumeElements::run_trial(bool with_stiffness, std::vector<Response>& responses) {
  std::vector<int> deaths(size(), 0);
  with_stiffness_ = with_stiffness;
  for (;;) {
    const std::int64_t stiffness = with_stiffness ? static_cast<std::int64_t>(options_.stiffness) : kNoStiffness;
    const Reply reply = worker_.request(Command::evaluate, stiffness, !options_.serialise);
    if (reply.kind == ReplyKind::done) {
      if (reply.value == 0 && !said_serialised_) {
        options_.say("volume elements are saved and restored at every trial instead of forked: slower" +
                     std::string(options_.serialise ? "" : " (fork was refused: not enough memory)"));
        said_serialised_ = true;
      }
      trial_pending_ = true;
      return;
    }
    fail_after_deaths(responses, deaths, reply.value);
  }
}

void PythonVolumeElements::fail_after_deaths(std::vector<Response>& responses, std::vector<int>& deaths,
                                             std::int64_t status) {
  const std::string cause = describe_wait_status(status);
  const auto index = worker_.in_flight();
  options_.say(fmt::format("a trial ended with {}; it is repeated", cause));
  if (!index || ++deaths.at(*index) < 2) return;
  worker_.slot(*index).task = Task::skip;
  responses[*index].failure = Failure{*index, fmt::format("its trial ended twice with {}", cause), kSmallerStep};
}

void PythonVolumeElements::read(std::size_t index, const Straining& straining, Operator wanted, Response& response) {
  const Slot& slot = worker_.slot(index);
  std::copy(slot.report.begin(), slot.report.end(), response.report.values.begin());
  if (slot.outcome != Outcome::answered) {
    response.failure = Failure{index, slot.sentence.data(), kSmallerStep};
    return;
  }
  Strained found{tensor(answers_mean(options_) ? slot.mean_stress : slot.stress), tensor(slot.stretch), {}};
  if (wanted == Operator::elastic) found.stiffness = Eigen::Map<const Tensor4>(slot.stiffness.data());
  judge(options_, straining, index, found, response);
}

void PythonVolumeElements::commit() {
  if (size() == 0) return;
  require_committable(trial_pending_, trial_failed_);
  peak_memory_ = std::max(peak_memory_, worker_.memory());
  const auto request = [&] {
    for (std::size_t i = 0; i < size(); ++i)
      worker_.slot(i).task = level(i) == points_[i].level ? Task::skip : Task::follow_network;
    return worker_.request(Command::commit);
  };
  Reply reply;
  try {
    reply = request();
  } catch (const UserError&) {  // the trial died while it waited: the inputs are still there
    options_.say("a trial ended before it was committed; it is repeated");
    for (std::size_t i = 0; i < size(); ++i) worker_.slot(i).task = Task::deform;
    std::vector<Response> responses(size());
    run_trial(with_stiffness_, responses);
    reply = request();
  }
  worker_.adopt(static_cast<pid_t>(reply.value));
  trial_pending_ = false;
  for (std::size_t i = 0; i < size(); ++i) {
    adopt_state(i);
    keep_report(i);
  }
  begin_step();
}

/// The state of a volume element, which goes on from it.
std::string PythonVolumeElements::save_one(std::size_t index) {
  std::string bytes = worker_.mail(worker_.request(Command::save, static_cast<std::int64_t>(index)));
  adopt_state(index);
  return encode({EngineKind::yade, points_[index].reference_time_scale, points_[index].origin, std::move(bytes)});
}

std::vector<PointReport> PythonVolumeElements::reports() {
  if (size() == 0) return {};
  drop_trial();
  worker_.request(Command::report);
  for (std::size_t i = 0; i < size(); ++i) {
    const auto& found = worker_.slot(i).report;
    auto& values = reports_[i].values;
    for (std::size_t k = 0; k < values.size(); ++k)
      if (std::isnan(values[k])) values[k] = found[k];
  }
  return reports_;
}

void PythonVolumeElements::save_each(const TakeState& take) {
  drop_trial();
  for (std::size_t i = 0; i < size(); ++i) take(save_one(i), std::array{i});
  begin_step();
}

void PythonVolumeElements::load_into(std::span<const std::size_t> points, const std::string& state) {
  drop_trial();
  for (const std::size_t i : points) {
    const StrainedPoint& point = points_.at(i);
    const VeState saved =
        decode(state).value_or(VeState{EngineKind::yade, point.reference_time_scale, point.origin, state});
    const bool compact = saved.engine == EngineKind::compact;
    if (compact) require_origin(saved.origin, point.origin);
    worker_.request(compact ? Command::write_back : Command::load, static_cast<std::int64_t>(i), 0,
                    compact ? CompactCell::load(saved.bytes).to_scene() : saved.bytes);
    points_[i].reference_time_scale = saved.reference_time_scale;
    adopt_state(i);
    keep_report(i);
  }
  begin_step();
}

void PythonVolumeElements::drop_trial() {
  if (trial_pending_) worker_.tell(Command::reject);
  trial_pending_ = false;
}

NetworkLevel PythonVolumeElements::level(std::size_t index) {
  const Slot& slot = worker_.slot(index);
  return network_level(tensor(slot.stretch), tensor(slot.stress));
}

void PythonVolumeElements::adopt_state(std::size_t index) {
  points_[index].stretch = tensor(worker_.slot(index).stretch);
  points_[index].level = level(index);
}

void PythonVolumeElements::keep_report(std::size_t index) {
  const auto& found = worker_.slot(index).report;
  std::copy(found.begin(), found.end(), reports_[index].values.begin());
}

}  // namespace femxdem
