#include "localisation.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace femxdem {
namespace {

constexpr int kDirections = 360;

double inclination_of(std::size_t direction) { return static_cast<double>(direction) * std::numbers::pi / kDirections; }

/// Normals of the bands, made once: sines cost twice what the determinants do.
const std::array<Eigen::Vector2d, kDirections>& normals() {
  static const auto made = [] {
    std::array<Eigen::Vector2d, kDirections> n;
    for (std::size_t d = 0; d < n.size(); ++d) n[d] = {-std::sin(inclination_of(d)), std::cos(inclination_of(d))};
    return n;
  }();
  return made;
}

}  // namespace

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
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t direction = 0; direction < kDirections; ++direction) {
    const double determinant = acoustic_tensor(tangent, normals()[direction]).determinant();
    if (determinant >= smallest) continue;
    smallest = determinant;
    if (inclination != nullptr) *inclination = inclination_of(direction);
  }
  return smallest;
}

}  // namespace femxdem
