#include "python_volume_elements.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <unsupported/Eigen/MatrixFunctions>

#include "errors.hpp"
#include "tensor.hpp"

namespace femxdem {
namespace {

using RowMajor2 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Tensor2 tensor(const std::array<double, 9>& numbers) { return Eigen::Map<const RowMajor2>(numbers.data()); }

/// exp(A) - I by its series, without the cancellation that exp(A) - I suffers for small A; |A| of order 1 at most.
Tensor2 expm1(const Tensor2& A) {
  Tensor2 sum = A, term = A;
  for (int k = 2; term.norm() > 1e-18 * sum.norm() && k < 60; ++k) {
    term = term * A / k;
    sum += term;
  }
  return sum;
}

/// In which class of strain and of pressure a cell is; where it leaves it, its contact network may be another.
std::array<int, 2> network_level(const Slot& slot) {
  const Tensor2 F = tensor(slot.stretch);
  const double strain = 0.5 * Tensor2((F.transpose() * F).log()).norm();
  const double pressure = -tensor(slot.stress).trace() / 3;
  const double level = pressure > 0 ? std::floor(std::log2(pressure)) : -1e3;
  return {static_cast<int>(strain / 0.02), static_cast<int>(level)};
}

std::string unstrained(const Tensor2& F) {
  return fmt::format(
      "deformation gradient [{:.4g} {:.4g} {:.4g}; {:.4g} {:.4g} {:.4g}; {:.4g} {:.4g} {:.4g}] is not "
      "admissible (det F = {:.4g})",
      F(0, 0), F(0, 1), F(0, 2), F(1, 0), F(1, 1), F(1, 2), F(2, 0), F(2, 1), F(2, 2), F.determinant());
}

constexpr const char* kSmallerStep = "Try a smaller load step.";

}  // namespace

/// What the volume element is asked to do.
struct PythonVolumeElements::Plan {
  Tensor2 R = Tensor2::Identity();
  Tensor2 U = Tensor2::Identity();
  std::optional<Failure> refusal;
};

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
  worker_.request(Command::add, static_cast<std::int64_t>(count), 0, state);
  const std::size_t first = size();
  const VeInfo added = worker_.slot(first).info;
  if (!(added.time_scale > 0 && std::isfinite(added.time_scale) && added.time_step > 0))
    throw UserError(
        fmt::format("volume element: mean stress {:.3g} Pa, time step {:.3g} s: without pressure the inertial "
                    "number sets no rate; start from a state under compression",
                    added.mean_stress, added.time_step));
  committed_stretch_.resize(first + count);
  committed_level_.resize(first + count);
  reference_time_scale_.resize(first + count, added.time_scale);
  frozen_steps_.resize(first + count, 0);
  for (std::size_t i = first; i < size(); ++i) adopt_state(i);
  peak_memory_ = std::max(peak_memory_, worker_.memory());
}

void PythonVolumeElements::begin_step() { std::fill(frozen_steps_.begin(), frozen_steps_.end(), 0); }

std::vector<Response> PythonVolumeElements::evaluate(std::span<const Tensor2> F, Operator wanted) {
  if (wanted == Operator::tangent)
    throw UserError("volume elements have no tangent in closed form; choose the elastic or the quasi-Newton operator");
  if (F.size() != size()) throw std::invalid_argument("evaluate: one deformation gradient per volume element");
  drop_trial();
  std::vector<Response> responses(size());
  if (size() == 0) return responses;
  std::vector<Plan> plans;
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

PythonVolumeElements::Plan PythonVolumeElements::plan(std::size_t index, const Tensor2& F) {
  Plan plan;
  if (!F.allFinite() || F.determinant() <= 0) {
    plan.refusal = Failure{index, unstrained(F), kSmallerStep};
    return plan;
  }
  const PolarDecomposition polar = polar_decomposition(F);
  plan.R = polar.R;
  plan.U = polar.U;
  Slot& slot = worker_.slot(index);
  // ln of U U_n^-1, which is similar to a symmetric positive definite tensor: its eigenvalues are real and positive
  const Tensor2 increment = (plan.U * committed_stretch_[index].inverse()).log();
  const double size = increment.norm();
  if (!(size <= options_.max_increment)) {
    plan.refusal =
        Failure{index, fmt::format("strain increment {:.3g} in one trial, limit {:.3g}", size, options_.max_increment),
                kSmallerStep};
    return plan;
  }
  slot.steps = 0;
  if (size < 1e-14) return plan;
  const double rate = options_.inertial_number / reference_time_scale_[index];
  const long needed = std::max<long>(options_.min_steps, std::lround(std::ceil(size / (rate * slot.info.time_step))));
  long& steps = frozen_steps_[index];
  if (!options_.freeze_steps || steps == 0 || needed > 2 * steps) steps = needed;
  slot.steps = steps;
  const RowMajor2 L = expm1(increment / static_cast<double>(steps)) / slot.info.time_step;
  std::copy_n(L.data(), 9, slot.velocity_gradient.begin());
  return plan;
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

void PythonVolumeElements::read(std::size_t index, const Plan& plan, Operator wanted, Response& response) {
  const Slot& slot = worker_.slot(index);
  std::copy(slot.report.begin(), slot.report.end(), response.report.values.begin());
  const auto fail = [&](std::string sentence, std::string advice) {
    response.failure = Failure{index, std::move(sentence), std::move(advice)};
  };
  if (slot.outcome != Outcome::answered) return fail(slot.sentence.data(), kSmallerStep);
  const double miss = (tensor(slot.stretch) - plan.U).norm() / plan.U.norm();
  if (!(miss <= 1e-9))
    return fail(fmt::format("its cell missed the stretch by {:.2e} (relative), limit 1e-09", miss), kSmallerStep);
  if (response.report["contacts"] == 0)
    return fail("it has lost all its contacts: no stress, no unbalanced force",
                "It can carry no tension: keep it under pressure, give it ve.cohesion, or try a smaller load step.");
  const double unbalanced = response.report["unbalanced_force"];
  if (!(unbalanced <= options_.max_unbalanced_force) && slot.steps == 0)
    return fail(fmt::format("unbalanced force {:.1e} without any strain, limit {:.1e}", unbalanced,
                            options_.max_unbalanced_force),
                "The state that it starts from is not at rest: let the scene come to rest before it is adopted.");
  if (!(unbalanced <= options_.max_unbalanced_force))
    return fail(fmt::format("unbalanced force {:.1e} after {} steps, limit {:.1e}", unbalanced, slot.steps,
                            options_.max_unbalanced_force),
                fmt::format("Lower ve.inertial_number (now {:g}) or ve.time_step_safety.", options_.inertial_number));
  const Tensor2 stress = tensor(slot.stress);
  if (!stress.allFinite()) return fail("its stress is not a number", kSmallerStep);
  response.stress = rotate(stress, plan.R);
  if (wanted == Operator::elastic)
    response.stiffness = rotate(Tensor4(Eigen::Map<const Tensor4>(slot.stiffness.data())), plan.R);
}

void PythonVolumeElements::commit() {
  if (size() == 0) return;
  if (!trial_pending_) throw std::logic_error("commit: there is no trial");
  if (trial_failed_) throw std::logic_error("commit: a volume element failed in this trial");
  peak_memory_ = std::max(peak_memory_, worker_.memory());
  const auto request = [&] {
    for (std::size_t i = 0; i < size(); ++i)
      worker_.slot(i).task = network_level(worker_.slot(i)) == committed_level_[i] ? Task::skip : Task::follow_network;
    return worker_.request(Command::commit);
  };
  Reply reply;
  try {
    reply = request();
  } catch (const UserError&) {  // the trial died while it waited: the inputs are still there
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

SavedStates PythonVolumeElements::save() {
  drop_trial();
  SavedStates states;
  for (std::size_t i = 0; i < size(); ++i) {
    states.push_back(worker_.mail(worker_.request(Command::save, static_cast<std::int64_t>(i))));
    adopt_state(i);
  }
  begin_step();
  return states;
}

void PythonVolumeElements::load(const SavedStates& states) {
  if (states.size() != size())
    throw UserError(fmt::format("checkpoint: {} volume elements saved, {} expected", states.size(), size()));
  drop_trial();
  for (std::size_t i = 0; i < size(); ++i) {
    worker_.request(Command::load, static_cast<std::int64_t>(i), 0, states[i]);
    adopt_state(i);
  }
  begin_step();
}

void PythonVolumeElements::drop_trial() {
  if (trial_pending_) worker_.tell(Command::reject);
  trial_pending_ = false;
}

void PythonVolumeElements::adopt_state(std::size_t index) {
  committed_stretch_[index] = tensor(worker_.slot(index).stretch);
  committed_level_[index] = network_level(worker_.slot(index));
}

}  // namespace femxdem
