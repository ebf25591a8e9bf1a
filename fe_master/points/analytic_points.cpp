#include "analytic_points.hpp"

#include <array>
#include <cassert>
#include <cstring>

#include "errors.hpp"

namespace femxdem {
namespace {

/// F, stress and softening strain in one row of doubles.
constexpr int kStateSize = 19;

std::string to_bytes(const LawState& state) {
  Eigen::Matrix<double, kStateSize, 1> row;
  row << state.F.reshaped(), state.stress.reshaped(), state.softening_strain;
  return {reinterpret_cast<const char*>(row.data()), sizeof(double) * kStateSize};
}

LawState from_bytes(const std::string& bytes) {
  Eigen::Matrix<double, kStateSize, 1> row;
  std::memcpy(row.data(), bytes.data(), sizeof(double) * kStateSize);
  return {row.head<9>().reshaped(3, 3), row.segment<9>(9).reshaped(3, 3), row[18]};
}

}  // namespace

AnalyticPoints::AnalyticPoints(std::vector<AnalyticLaw> laws) : laws_(std::move(laws)) {
  for (const AnalyticLaw& law : laws_) {
    check(law);
    committed_.push_back(initial_state(law));
  }
  trial_ = committed_;
}

std::vector<Response> AnalyticPoints::evaluate(std::span<const Tensor2> F, Operator wanted) {
  assert(F.size() == size());
  std::vector<Response> responses(size());
  for (std::size_t i = 0; i < size(); ++i) {
    responses[i] = update(laws_[i], committed_[i], F[i], wanted, trial_[i]);
    if (responses[i].failure) responses[i].failure->point = i;
  }
  return responses;
}

void AnalyticPoints::save_each(const TakeState& take) {
  for (std::size_t i = 0; i < size(); ++i) take(to_bytes(committed_[i]), std::array{i});
}

void AnalyticPoints::load_each(const StateSource& states) {
  require_states_of(size(), states);
  for (const auto& [number, points] : states.points_of_states()) {
    const std::string state = states.read(number);
    if (state.size() != sizeof(double) * kStateSize)
      throw UserError("checkpoint: its material points are no analytic laws; restart with the case it was written by");
    for (const std::size_t i : points) committed_[i] = from_bytes(state);
  }
  trial_ = committed_;
}

}  // namespace femxdem
