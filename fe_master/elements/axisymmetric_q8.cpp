#include "axisymmetric_q8.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "errors.hpp"

namespace femxdem {

AxisymmetricQ8::AxisymmetricQ8(const Mesh& mesh) : Formulation(mesh, {0, 1, 2, 5}) {
  double radius = 0;
  for (const Point2& X : mesh.nodes) radius = std::max(radius, X.x());
  for (const Point2& X : mesh.nodes) {
    if (X.x() < -1e-9 * radius || radius == 0) {
      throw UserError(
          fmt::format("mesh: node ({:.4g}, {:.4g}) lies on the left of the axis x = 0 of axisymmetric elements; move "
                      "the mesh to x >= 0",
                      X.x(), X.y()));
    }
  }
  for (PointShapes& s : shapes_) s.weight *= thickness(s.X);
}

Formulation::GradientMatrix AxisymmetricQ8::B(std::size_t point) const {
  const PointShapes& s = shapes_[point];
  GradientMatrix B = in_plane(point);
  for (int a = 0; a < 8; ++a) B(pair(2, 2), 2 * a) = s.N8[a] / s.X.x();
  return B;
}

double AxisymmetricQ8::thickness(const Point2& position) const { return 2 * std::numbers::pi * position.x(); }

SweptVolume AxisymmetricQ8::swept_volume(const Point2& position, const Point2& tangent) const {
  const double disc = std::numbers::pi * position.x() * position.x();
  return {-disc * tangent.y(), Point2(-thickness(position) * tangent.y(), 0), Point2(0, -disc)};
}

}  // namespace femxdem
