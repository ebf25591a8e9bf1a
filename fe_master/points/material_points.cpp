#include "material_points.hpp"

namespace femxdem {

void commit(MaterialPoints& points, std::span<Response> responses) {
  points.commit();
  const std::vector<PointReport> reports = points.reports();
  for (std::size_t i = 0; i < reports.size(); ++i) responses[i].report = reports[i];
}

std::string describe(const Failure& failure) {
  const bool stops = failure.sentence.empty() || failure.sentence.back() == '.';
  return failure.sentence + (stops ? " " : ". ") + failure.advice;
}

}  // namespace femxdem
