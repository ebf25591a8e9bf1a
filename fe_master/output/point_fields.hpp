#pragma once

#include <span>
#include <vector>

#include "field.hpp"
#include "material_points.hpp"
#include "tensor.hpp"

namespace femxdem {

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
