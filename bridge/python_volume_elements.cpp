#include "python_volume_elements.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "compact_cell.hpp"
#include "errors.hpp"
#include "hash.hpp"

namespace femxdem {
namespace {

using RowMajor2 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Tensor2 tensor(const std::array<double, 9>& numbers) { return Eigen::Map<const RowMajor2>(numbers.data()); }

}  // namespace

PythonVolumeElements::PythonVolumeElements(WorkerProcess& worker, VolumeElementOptions options)
    : worker_(worker), options_(std::move(options)) {}

PythonVolumeElements::Template PythonVolumeElements::make_template(const std::string& specification_json) {
  drop_trial();
  const Reply reply = worker_.request(Command::make_template, 0, 0, specification_json);
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
  for (std::size_t i = first; i < size(); ++i) adopt_state(i);
  peak_memory_ = std::max(peak_memory_, worker_.memory());
}

void PythonVolumeElements::remove(std::size_t index) {
  drop_trial();
  worker_.request(Command::remove, static_cast<std::int64_t>(index));
  points_.erase(points_.begin() + static_cast<std::ptrdiff_t>(index));
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
  run_trial(wanted == Operator::elastic, responses);
  for (std::size_t i = 0; i < size(); ++i)
    if (!responses[i].failure) read(i, plans[i], wanted, responses[i]);
  trial_failed_ = std::any_of(responses.begin(), responses.end(), [](const Response& r) { return r.failure; });
  return responses;
}

Straining PythonVolumeElements::plan(std::size_t index, const Tensor2& F) {
  Slot& slot = worker_.slot(index);
  const Straining straining = plan_straining(options_, points_[index], slot.info.time_step, index, F);
  slot.steps = straining.steps;
  slot.velocity_gradient = straining.velocity_gradient;
  slot.sample_every = answers_mean(options_) ? kSampleEvery : 0;
  slot.late = lateness(options_, straining.steps);
  return straining;
}

void PythonVolumeElements::run_trial(bool with_stiffness, std::vector<Response>& responses) {
  std::vector<int> deaths(size(), 0);
  with_stiffness_ = with_stiffness;
  for (;;) {
    const std::int64_t stiffness = !with_stiffness ? kNoStiffness : options_.relaxed ? kRelaxed : kAffine;
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
  if (!trial_pending_) throw std::logic_error("commit: there is no trial");
  if (trial_failed_) throw std::logic_error("commit: a volume element failed in this trial");
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
  for (std::size_t i = 0; i < size(); ++i) adopt_state(i);
  begin_step();
}

/// The state of a volume element, which goes on from it.
std::string PythonVolumeElements::save_one(std::size_t index) {
  std::string bytes = worker_.mail(worker_.request(Command::save, static_cast<std::int64_t>(index)));
  adopt_state(index);
  return encode({EngineKind::yade, points_[index].reference_time_scale, points_[index].origin, std::move(bytes)});
}

std::vector<PointReport> PythonVolumeElements::reports() const {
  std::vector<PointReport> reports(size());
  for (std::size_t i = 0; i < size(); ++i) reports[i].values = worker_.slot(i).report;
  return reports;
}

SavedStates PythonVolumeElements::save() {
  drop_trial();
  SavedStates states;
  for (std::size_t i = 0; i < size(); ++i) {
    states.push_back(save_one(i));
  }
  begin_step();
  return states;
}

void PythonVolumeElements::load(const SavedStates& states) {
  if (states.size() != size())
    throw UserError(fmt::format("checkpoint: {} volume elements saved, {} expected", states.size(), size()));
  drop_trial();
  for (std::size_t i = 0; i < size(); ++i) {
    const StrainedPoint& point = points_[i];
    const VeState state =
        decode(states[i]).value_or(VeState{EngineKind::yade, point.reference_time_scale, point.origin, states[i]});
    const bool compact = state.engine == EngineKind::compact;
    if (compact) require_origin(state.origin, point.origin);
    worker_.request(compact ? Command::write_back : Command::load, static_cast<std::int64_t>(i), 0,
                    compact ? CompactCell::load(state.bytes).to_scene() : state.bytes);
    points_[i].reference_time_scale = state.reference_time_scale;
    adopt_state(i);
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

}  // namespace femxdem
