#include "localisation.hpp"

#include <cmath>
#include <limits>
#include <numbers>

namespace femxdem {

double min_acoustic_determinant(const Tensor4& tangent, double* inclination) {
  constexpr int kDirections = 360;
  double smallest = std::numeric_limits<double>::infinity();
  for (int direction = 0; direction < kDirections; ++direction) {
    const double angle = direction * std::numbers::pi / kDirections;
    const double n[2] = {-std::sin(angle), std::cos(angle)};
    Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j)
        for (int k = 0; k < 2; ++k)
          for (int l = 0; l < 2; ++l) A(i, k) += n[j] * tangent(pair(i, j), pair(k, l)) * n[l];
    const double determinant = A.determinant();
    if (determinant >= smallest) continue;
    smallest = determinant;
    if (inclination != nullptr) *inclination = angle;
  }
  return smallest;
}

}  // namespace femxdem
