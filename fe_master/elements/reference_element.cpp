#include "reference_element.hpp"

#include <cmath>

namespace femxdem {
namespace {

constexpr std::array<double, 8> kXi = {-1, 1, 1, -1, 0, 1, 0, -1};
constexpr std::array<double, 8> kEta = {-1, -1, 1, 1, -1, 0, 1, 0};

}  // namespace

Shape8 shape_q8(double xi, double eta) {
  Shape8 N;
  for (int a = 0; a < 4; ++a) {
    const double x = kXi[a] * xi, y = kEta[a] * eta;
    N[a] = 0.25 * (1 + x) * (1 + y) * (x + y - 1);
  }
  for (int a = 4; a < 8; ++a) {
    N[a] = kXi[a] == 0 ? 0.5 * (1 - xi * xi) * (1 + kEta[a] * eta) : 0.5 * (1 + kXi[a] * xi) * (1 - eta * eta);
  }
  return N;
}

Gradient8 shape_gradient_q8(double xi, double eta) {
  Gradient8 dN;
  for (int a = 0; a < 4; ++a) {
    const double x = kXi[a] * xi, y = kEta[a] * eta;
    dN(a, 0) = 0.25 * kXi[a] * (1 + y) * (2 * x + y);
    dN(a, 1) = 0.25 * kEta[a] * (1 + x) * (x + 2 * y);
  }
  for (int a = 4; a < 8; ++a) {
    if (kXi[a] == 0) {
      dN(a, 0) = -xi * (1 + kEta[a] * eta);
      dN(a, 1) = 0.5 * kEta[a] * (1 - xi * xi);
    } else {
      dN(a, 0) = 0.5 * kXi[a] * (1 - eta * eta);
      dN(a, 1) = -eta * (1 + kXi[a] * xi);
    }
  }
  return dN;
}

Eigen::Vector4d shape_q4(double xi, double eta) {
  Eigen::Vector4d N;
  for (int a = 0; a < 4; ++a) N[a] = 0.25 * (1 + kXi[a] * xi) * (1 + kEta[a] * eta);
  return N;
}

Gradient4 shape_gradient_q4(double xi, double eta) {
  Gradient4 dN;
  for (int a = 0; a < 4; ++a) {
    dN(a, 0) = 0.25 * kXi[a] * (1 + kEta[a] * eta);
    dN(a, 1) = 0.25 * kEta[a] * (1 + kXi[a] * xi);
  }
  return dN;
}

Eigen::Vector3d shape_edge(double s) { return {0.5 * s * (s - 1), 1 - s * s, 0.5 * s * (s + 1)}; }

Eigen::Vector3d shape_gradient_edge(double s) { return {s - 0.5, -2 * s, s + 0.5}; }

const std::array<QuadraturePoint, 4>& gauss_2x2() {
  static const double g = 1 / std::sqrt(3.0);
  static const std::array<QuadraturePoint, 4> points = {{{-g, -g, 1}, {g, -g, 1}, {g, g, 1}, {-g, g, 1}}};
  return points;
}

const std::array<EdgePoint, 3>& gauss_edge() {
  static const double g = std::sqrt(0.6);
  static const std::array<EdgePoint, 3> points = {{{-g, 5.0 / 9}, {0, 8.0 / 9}, {g, 5.0 / 9}}};
  return points;
}

}  // namespace femxdem
