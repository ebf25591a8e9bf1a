#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>

#include "compact_step.hpp"

namespace femxdem {
namespace {

/// Cell vector `changed` becomes itself plus `times` the two others: another basis of the same lattice.
struct Flip {
  std::size_t changed = 0;
  std::array<std::size_t, 2> by{};
  std::array<int, 2> times{};
};

/// Takes the two others off cell vector `changed` until what lies in their plane is within half of either. The
/// operations are those of YADE's Cell.flipCell, so that both engines flip at the same step.
Flip shortening(const Row3& H, std::size_t changed) {
  Flip flip{changed, {(changed + 1) % 3, (changed + 2) % 3}, {}};
  Eigen::Matrix3d frame = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(H.data());
  const auto column = [&](std::size_t k) { return frame.col(static_cast<Eigen::Index>(k)); };
  const Eigen::Vector3d vector = column(changed);
  const Eigen::Vector3d normal = column(flip.by[0]).cross(column(flip.by[1]));
  column(changed) = normal;
  const Eigen::Vector3d along = frame.inverse() * vector;
  for (std::size_t k = 0; k < 2; ++k)
    flip.times[k] = -static_cast<int>(std::floor(along[static_cast<Eigen::Index>(flip.by[k])] + 0.5));
  return flip;
}

void apply(const Flip& flip, Row3& H) {
  for (std::size_t row = 0; row < 9; row += 3)
    H[row + flip.changed] += H[row + flip.by[0]] * flip.times[0] + H[row + flip.by[1]] * flip.times[1];
}

/// H cd stays what it is.
std::int32_t apply(const Flip& flip, std::int32_t packed) {
  std::array<int, 3> shift = {unpack_shift(packed, 0), unpack_shift(packed, 1), unpack_shift(packed, 2)};
  for (std::size_t k = 0; k < 2; ++k) {
    shift[flip.by[k]] -= flip.times[k] * shift[flip.changed];
    if (std::abs(shift[flip.by[k]]) > kMaxShift)
      throw std::runtime_error("A sphere has left its cell far behind: its velocity makes no sense.");
  }
  return pack_shift(shift[0], shift[1], shift[2]);
}

}  // namespace

bool flip(CompactBlock& block) {
  CompactHeader& h = block.header();
  const CompactArrays& a = block.arrays();
  bool changed = false;
  for (std::size_t k = 0; k < 3; ++k) {
    const Flip f = shortening(h.H, k);
    if (f.times == std::array{0, 0}) continue;
    changed = true;
    apply(f, h.H);
    apply(f, h.list_H);
    for (std::uint32_t c = 0; c < h.contacts; ++c) a.shift[c] = apply(f, a.shift[c]);
    for (std::uint32_t p = 0; p < h.pairs; ++p) a.pairs[p].shift = apply(f, a.pairs[p].shift);
  }
  return changed;
}

std::array<double, 3> widths(const Row3& inverse_H) {
  std::array<double, 3> w;
  for (std::size_t k = 0; k < 3; ++k) {
    const double* row = &inverse_H[3 * k];
    w[k] = 1 / std::sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2]);
  }
  return w;
}

double room(const CompactHeader& h) {
  const std::array<double, 3> width = widths(inverse(h.H));
  return 0.5 * *std::min_element(width.begin(), width.end()) - 2 * h.max_radius;
}

}  // namespace femxdem
