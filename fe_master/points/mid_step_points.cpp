#include "mid_step_points.hpp"

#include <cassert>

namespace femxdem {

std::vector<Response> MidStepPoints::evaluate(std::span<const Tensor2> F, Operator wanted) {
  if (theta_ == 1) return points_.evaluate(F, wanted);
  assert(start_.size() == F.size());
  std::vector<Tensor2> ends;
  for (std::size_t p = 0; p < F.size(); ++p) ends.push_back(end(start_[p], F[p]));
  std::vector<Response> responses = points_.evaluate(ends, wanted);
  for (std::size_t p = 0; p < F.size(); ++p) {
    Response& response = responses[p];
    if (response.failure) continue;
    const Tensor2 turn = polar_decomposition(F[p]).R * polar_decomposition(ends[p]).R.transpose();
    response.stress = rotate(response.stress, turn);
    if (wanted != Operator::none) response.stiffness = rotate(response.stiffness, turn);
  }
  return responses;
}

std::vector<Tensor2> MidStepPoints::end_stresses(std::span<const Tensor2> F, std::span<const Response> responses) {
  std::vector<Tensor2> stresses;
  for (std::size_t p = 0; p < F.size(); ++p)
    stresses.push_back(rotate(end_stress(responses[p].report), polar_decomposition(F[p]).R));
  return stresses;
}

}  // namespace femxdem
