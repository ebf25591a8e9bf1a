#include "point_fields.hpp"

#include <cassert>
#include <cmath>

namespace femxdem {
namespace {

Field tensors(std::string name, std::span<const Tensor2> values) {
  Field field{std::move(name), 9, {}};
  field.values.reserve(9 * values.size());
  for (const Tensor2& T : values) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) field.values.push_back(T(i, j));
    }
  }
  return field;
}

template <class Invariant>
Field scalars(std::string name, std::span<const Tensor2> tensors, Invariant invariant) {
  Field field{std::move(name), 1, {}};
  for (const Tensor2& T : tensors) field.values.push_back(invariant(T));
  return field;
}

double deviatoric_norm(const Tensor2& T) { return (T - T.trace() / 3 * Tensor2::Identity()).norm(); }

}  // namespace

std::vector<Field> point_fields(std::span<const Tensor2> F, std::span<const Tensor2> stress,
                                std::span<const PointReport> reports) {
  assert(F.size() == stress.size() && F.size() == reports.size());
  std::vector<Field> fields = {
      tensors("stress", stress),
      tensors("deformation_gradient", F),
      scalars("mean_stress", stress, [](const Tensor2& T) { return T.trace() / 3; }),
      scalars("deviatoric_stress", stress, [](const Tensor2& T) { return std::sqrt(1.5) * deviatoric_norm(T); }),
      scalars("strain_invariant", F, [](const Tensor2& T) { return deviatoric_norm(logarithmic_strain(T)); }),
      scalars("volumetric_strain", F, [](const Tensor2& T) { return std::log(T.determinant()); }),
  };
  for (std::size_t entry = 0; entry < kReportFields.size(); ++entry) {
    Field field{std::string(kReportFields[entry]), 1, {}};
    for (const PointReport& report : reports) field.values.push_back(report.values[entry]);
    fields.push_back(std::move(field));
  }
  return fields;
}

Field second_order_work(std::span<const Tensor2> F_before, std::span<const Tensor2> stress_before,
                        std::span<const Tensor2> F, std::span<const Tensor2> stress) {
  assert(F_before.size() == F.size() && stress_before.size() == F.size() && stress.size() == F.size());
  Field field{"second_order_work", 1, {}};
  for (std::size_t point = 0; point < F.size(); ++point) {
    const Tensor2 dP = first_piola(stress[point], F[point]) - first_piola(stress_before[point], F_before[point]);
    field.values.push_back(dP.cwiseProduct(F[point] - F_before[point]).sum());
  }
  return field;
}

}  // namespace femxdem
