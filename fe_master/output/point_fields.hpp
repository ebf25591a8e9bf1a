#pragma once

#include <span>
#include <string>
#include <vector>

#include "material_points.hpp"
#include "tensor.hpp"

namespace femxdem {

/// Values of one quantity at all nodes or at all Gauss points: `components` numbers each, tensors row by row.
struct Field {
  std::string name;
  std::size_t components = 1;
  std::vector<double> values;
};

/// What a results file holds of every Gauss point, in the order of the points:
/// `stress` (3 x 3, Cauchy, tension positive) [Pa], `deformation_gradient` (3 x 3), `mean_stress` tr(sigma) / 3 [Pa],
/// `deviatoric_stress` sqrt(3/2) |dev sigma| [Pa], `strain_invariant` |dev ln U| (second invariant of the logarithmic
/// strain), `volumetric_strain` tr ln U = ln det F, and every entry of kReportFields. The three spans have equal sizes.
std::vector<Field> point_fields(std::span<const Tensor2> F, std::span<const Tensor2> stress,
                                std::span<const PointReport> reports);

/// `second_order_work` [Pa] of an increment, per reference volume (Hill, 1958): dP : dF with the first Piola-Kirchhoff
/// stress P = det F sigma F^-T; negative where the material can lose stability.
Field second_order_work(std::span<const Tensor2> F_before, std::span<const Tensor2> stress_before,
                        std::span<const Tensor2> F, std::span<const Tensor2> stress);

}  // namespace femxdem
