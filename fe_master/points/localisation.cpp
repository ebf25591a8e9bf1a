#include "localisation.hpp"

#include <cmath>
#include <limits>
#include <numbers>

namespace femxdem {

Eigen::Matrix2d acoustic_tensor(const Tensor4& C, const Eigen::Vector2d& n) {
  Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      for (int k = 0; k < 2; ++k) {
        for (int l = 0; l < 2; ++l) A(i, k) += n[j] * C(pair(i, j), pair(k, l)) * n[l];
      }
    }
  }
  return A;
}

double min_acoustic_determinant(const Tensor4& tangent, double* inclination) {
  constexpr int kDirections = 360;
  double smallest = std::numeric_limits<double>::infinity();
  for (int direction = 0; direction < kDirections; ++direction) {
    const double angle = direction * std::numbers::pi / kDirections;
    const double determinant = acoustic_tensor(tangent, {-std::sin(angle), std::cos(angle)}).determinant();
    if (determinant >= smallest) continue;
    smallest = determinant;
    if (inclination != nullptr) *inclination = angle;
  }
  return smallest;
}

}  // namespace femxdem
