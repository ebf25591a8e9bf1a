#include "lagging_states.hpp"

namespace femxdem {

std::vector<Tensor2> LaggingStates::begin_step(std::vector<Tensor2> start, const PointOperators& operators) {
  if (!active_) return start;
  ahead_.clear();
  drift_.clear();
  for (std::size_t p = 0; p < start.size(); ++p) {
    ahead_.push_back(points_.within<Tensor2>(state_[p] - start[p], Tensor2::Zero()));
    const Tensor2 R = polar_decomposition(start[p]).R;
    drift_.push_back(
        rotate(operators.predict(p, start[p], start[p] + ahead_[p], Tensor2::Zero()), Tensor2(R.transpose())));
  }
  return state_;
}

std::vector<Tensor2> LaggingStates::asked(std::vector<Tensor2> F) {
  if (!active_) return F;
  for (std::size_t p = 0; p < F.size(); ++p) F[p] += ahead_[p];
  return last_ = std::move(F);
}

void LaggingStates::complete(std::span<const Tensor2> F, std::span<Response> responses) const {
  for (std::size_t p = 0; active_ && p < F.size(); ++p) {
    const Tensor2 R = polar_decomposition(F[p]).R;
    responses[p].stress =
        rotate(responses[p].stress, Tensor2(R * polar_decomposition(last_[p]).R.transpose())) + rotate(drift_[p], R);
  }
}

void LaggingStates::commit() {
  for (std::size_t p = 0; active_ && p < state_.size(); ++p) state_[p] = points_.end(state_[p], last_[p]);
}

std::vector<Tensor2> LaggingStates::end_stresses(std::span<const Tensor2> F, std::span<const Response> responses,
                                                 const PointOperators& operators) const {
  if (!active_) return MidStepPoints::end_stresses(F, responses);
  std::vector<Tensor2> stresses = MidStepPoints::end_stresses(state_, responses);
  for (std::size_t p = 0; p < F.size(); ++p) stresses[p] = operators.predict(p, F[p], state_[p], stresses[p]);
  return stresses;
}

void LaggingStates::save(NamedArrays& arrays) const {
  if (active_) add_tensors(arrays, "solver.lagging_states", state_);
}

void LaggingStates::load(const NamedArrays& arrays) {
  if (active_) find_tensors(arrays, "solver.lagging_states", state_);
}

}  // namespace femxdem
