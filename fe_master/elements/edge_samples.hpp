#pragma once

#include <string>
#include <vector>

#include "mesh.hpp"

namespace femxdem {

/// Gauss point of a side of a named edge: int_edge f(x, dx/ds) ds is the sum of weight * f over all of them.
struct EdgeSample {
  std::array<int, 3> nodes;
  Eigen::Vector3d N, dN;  ///< of the nodes: shape functions and their derivatives d/ds
  double weight;          ///< of s in [-1, 1]
  Point2 position;        ///< x [m]
  Point2 tangent;         ///< dx/ds [m], the material on its left
};

/// Samples of an edge in the order of its sides: in the reference configuration, or where the displacements (node by
/// node, the head of the unknowns x) have taken it.
std::vector<EdgeSample> edge_samples(const Mesh& mesh, const std::string& edge);
std::vector<EdgeSample> edge_samples(const Mesh& mesh, const std::string& edge, const Eigen::VectorXd& x);

/// A tangent turned to the outer side, with its length.
inline Point2 outward_normal(const Point2& tangent) { return {tangent.y(), -tangent.x()}; }

}  // namespace femxdem
