#pragma once

#include "formulation.hpp"

namespace femxdem {

/// Plane strain of the first gradient: F33 = 1, everything per unit thickness.
class PlaneStrainQ8 : public Formulation {
 public:
  explicit PlaneStrainQ8(const Mesh& mesh) : Formulation(mesh, kPlaneStrain) {}

  GradientMatrix B(std::size_t point) const override { return in_plane(point); }
  double thickness(const Point2&) const override { return 1; }
};

}  // namespace femxdem
