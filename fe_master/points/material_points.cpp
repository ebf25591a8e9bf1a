#include "material_points.hpp"

#include <algorithm>
#include <stdexcept>

namespace femxdem {
namespace {

std::size_t report_index(std::string_view field) {
  const auto found = std::find(kReportFields.begin(), kReportFields.end(), field);
  if (found == kReportFields.end()) throw std::out_of_range("no report field named " + std::string(field));
  return static_cast<std::size_t>(found - kReportFields.begin());
}

}  // namespace

double& PointReport::operator[](std::string_view field) { return values[report_index(field)]; }

double PointReport::operator[](std::string_view field) const { return values[report_index(field)]; }

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
