#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>

#include "compact_step.hpp"

namespace femxdem {
namespace {

constexpr double kLonger = 0.5 + 1e-9;  ///< share of another cell vector in one from which on it can be shortened
constexpr double kNarrow = 0.1;  ///< room beside the largest spheres, over the smallest radius, that asks for a flip

/// Cell vector `changed` becomes itself minus `times` cell vector `by`: another basis of the same lattice.
struct Flip {
  std::size_t changed = 0, by = 0;
  int times = 0;
};

double product_of_columns(const Row3& H, std::size_t p, std::size_t q) {
  return H[p] * H[q] + H[3 + p] * H[3 + q] + H[6 + p] * H[6 + q];
}

void apply(const Flip& flip, Row3& H) {
  for (std::size_t row = 0; row < 9; row += 3) H[row + flip.changed] -= flip.times * H[row + flip.by];
}

/// H cd stays what it is.
std::int32_t apply(const Flip& flip, std::int32_t packed) {
  std::array<int, 3> shift = {unpack_shift(packed, 0), unpack_shift(packed, 1), unpack_shift(packed, 2)};
  shift[flip.by] += flip.times * shift[flip.changed];
  if (std::abs(shift[flip.by]) > kMaxShift)
    throw std::runtime_error("A sphere has left its cell far behind: its velocity makes no sense.");
  return pack_shift(shift[0], shift[1], shift[2]);
}

/// A change that makes a cell vector shorter, or one of zero times.
Flip shortening(const Row3& H) {
  for (std::size_t p = 0; p < 3; ++p) {
    for (std::size_t q = 0; q < 3; ++q) {
      if (p == q) continue;
      const double share = product_of_columns(H, p, q) / product_of_columns(H, q, q);
      if (std::abs(share) > kLonger) return {p, q, static_cast<int>(std::lround(share))};
    }
  }
  return {};
}

}  // namespace

bool flip(CompactBlock& block) {
  CompactHeader& h = block.header();
  const CompactArrays& a = block.arrays();
  bool changed = false;
  for (Flip f = shortening(h.H); f.times != 0; f = shortening(h.H), changed = true) {
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

void flip_when_narrow(CompactBlock& block) {
  if (room(block.header()) < kNarrow * block.header().min_radius) flip(block);
}

}  // namespace femxdem
