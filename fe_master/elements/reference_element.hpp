#pragma once

#include <Eigen/Dense>
#include <array>

namespace femxdem {

using Shape8 = Eigen::Matrix<double, 8, 1>;
using Gradient8 = Eigen::Matrix<double, 8, 2>;
using Gradient4 = Eigen::Matrix<double, 4, 2>;

/// Serendipity shape functions of the 8-node quadrilateral at (xi, eta) in [-1, 1]^2; node order of Mesh.
Shape8 shape_q8(double xi, double eta);
/// Their derivatives, (8, 2): d N_a / d(xi, eta).
Gradient8 shape_gradient_q8(double xi, double eta);
/// Bilinear shape functions of the 4 corners.
Eigen::Vector4d shape_q4(double xi, double eta);
/// Their derivatives, (4, 2).
Gradient4 shape_gradient_q4(double xi, double eta);
/// Quadratic shape functions of an edge (first corner, mid-side, second corner) at s in [-1, 1].
Eigen::Vector3d shape_edge(double s);
/// Their derivatives d N_a / ds.
Eigen::Vector3d shape_gradient_edge(double s);

struct QuadraturePoint {
  double xi, eta, weight;
};
/// 2 x 2 Gauss points, counter-clockwise from (-, -): point q is nearest to corner q.
const std::array<QuadraturePoint, 4>& gauss_2x2();

struct EdgePoint {
  double s, weight;
};
/// 3 Gauss points of an edge.
const std::array<EdgePoint, 3>& gauss_edge();

}  // namespace femxdem
