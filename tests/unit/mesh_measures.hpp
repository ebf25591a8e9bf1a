#pragma once

#include <string>

#include "edge_samples.hpp"
#include "reference_element.hpp"

namespace femxdem {

/// Length of a named edge along its quadratic sides [m].
inline double edge_length(const Mesh& mesh, const std::string& edge) {
  double length = 0;
  for (const EdgeSample& g : edge_samples(mesh, edge)) length += g.weight * g.tangent.norm();
  return length;
}

/// det dX/dxi of an element at a point of the reference one [m2].
inline double jacobian(const Mesh& mesh, int element, double xi, double eta) {
  Eigen::Matrix2d J = Eigen::Matrix2d::Zero();
  const Gradient8 gradient = shape_gradient_q8(xi, eta);
  for (int a = 0; a < 8; ++a) J += mesh.nodes[mesh.elements[element][a]] * gradient.row(a);
  return J.determinant();
}

/// Of the whole mesh, by 2 x 2 points in each element [m2].
inline double area(const Mesh& mesh) {
  double sum = 0.0;
  for (int e = 0; e < static_cast<int>(mesh.elements.size()); ++e) {
    for (const auto& q : gauss_2x2()) sum += q.weight * jacobian(mesh, e, q.xi, q.eta);
  }
  return sum;
}

}  // namespace femxdem
