#pragma once

#include "formulation.hpp"

namespace femxdem {

/// Bodies of revolution about the y axis without torsion: x is the radius r, y the axis z, 33 the circumference, and
/// F33 = 1 + u_r / r. Everything is of the full circumference: weights 2 pi r dA, forces [N].
class AxisymmetricQ8 : public Formulation {
 public:
  /// Throws UserError where the mesh lies on the left of the axis.
  explicit AxisymmetricQ8(const Mesh& mesh);

  GradientMatrix B(std::size_t point) const override;
  double thickness(const Point2& position) const override;
  /// Of a cavity about the axis, between the planes z of the edge's ends: -pi r^2 dz/ds.
  SweptVolume swept_volume(const Point2& position, const Point2& tangent) const override;
  const char* volume_unit() const override { return "m3"; }
};

}  // namespace femxdem
