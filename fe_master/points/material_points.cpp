#include "material_points.hpp"

#include <string_view>
#include <unordered_map>

#include "errors.hpp"

namespace femxdem {

Tensor2 end_stress(const PointReport& report) {
  Tensor2 s;
  s(0, 0) = report["end_stress_xx"], s(1, 1) = report["end_stress_yy"], s(2, 2) = report["end_stress_zz"];
  s(0, 1) = s(1, 0) = report["end_stress_xy"];
  s(1, 2) = s(2, 1) = report["end_stress_yz"];
  s(2, 0) = s(0, 2) = report["end_stress_zx"];
  return s;
}

std::vector<std::pair<int, std::vector<std::size_t>>> StateSource::points_of_states() const {
  std::vector<std::pair<int, std::vector<std::size_t>>> shares;
  std::unordered_map<int, std::size_t> place;
  for (std::size_t p = 0; p < number_of_point.size(); ++p) {
    const auto [entry, is_new] = place.emplace(number_of_point[p], shares.size());
    if (is_new) shares.emplace_back(number_of_point[p], std::vector<std::size_t>());
    shares[entry->second].second.push_back(p);
  }
  return shares;
}

StateSource source_of(const SavedStates& states) {
  StateSource source;
  std::unordered_map<std::string_view, int> first_with;
  for (std::size_t p = 0; p < states.size(); ++p)
    source.number_of_point.push_back(first_with.emplace(states[p], static_cast<int>(p)).first->second);
  source.read = [&states](int number) { return states.at(static_cast<std::size_t>(number)); };
  return source;
}

SavedStates MaterialPoints::save() {
  SavedStates states(size());
  save_each([&](const std::string& state, std::span<const std::size_t> points) {
    for (const std::size_t p : points) states[p] = state;
  });
  return states;
}

void MaterialPoints::load(const SavedStates& states) { load_each(source_of(states)); }

void LocalPoints::load_each(const StateSource& states) {
  require_states_of(size(), states);
  for (const auto& [number, points] : states.points_of_states()) load_into(points, states.read(number));
}

void require_states_of(std::size_t points, const StateSource& states) {
  const std::size_t saved = states.number_of_point.size();
  if (saved != points)
    throw UserError("checkpoint: " + std::to_string(saved) + " material points saved, the case has " +
                    std::to_string(points) + "; restart with the case it was written by");
}

void complete_reports(MaterialPoints& points, std::span<Response> responses) {
  const std::vector<PointReport> reports = points.reports();
  for (std::size_t i = 0; i < reports.size(); ++i) responses[i].report = reports[i];
}

std::string describe(const Failure& failure) {
  const bool stops = failure.sentence.empty() || failure.sentence.back() == '.';
  return failure.sentence + (stops ? " " : ". ") + failure.advice;
}

}  // namespace femxdem
