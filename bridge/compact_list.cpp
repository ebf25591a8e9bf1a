#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "compact_step.hpp"

namespace femxdem {
namespace {

constexpr double kSkin = 0.4;  ///< of the smallest radius
constexpr int kFewBins = 3;    ///< with fewer along a direction, neighbours would be met twice

/// Spheres sorted into bins of the cell at least `reach` wide.
class Bins {
 public:
  Bins(const CompactArrays& a, const Row3& inverse_H, const std::array<double, 3>& width, double reach) {
    for (std::size_t k = 0; k < 3; ++k) count_[k] = std::clamp(static_cast<int>(width[k] / reach), 1, 64);
    const std::size_t n = a.header->spheres;
    bin_.resize(n);
    next_.resize(n);
    first_.assign(static_cast<std::size_t>(count_[0] * count_[1] * count_[2]), -1);
    for (std::size_t s = n; s-- > 0;) {
      std::array<int, 3> place;
      for (std::size_t k = 0; k < 3; ++k) {
        const double* row = &inverse_H[3 * k];
        const auto& x = a.spheres[s].x;
        const double along = row[0] * x[0] + row[1] * x[1] + row[2] * x[2];
        place[k] = std::clamp(static_cast<int>((along - std::floor(along)) * count_[k]), 0, count_[k] - 1);
      }
      bin_[s] = place;
      int& first = first_[index(place)];
      next_[s] = first;
      first = static_cast<int>(s);
    }
  }

  /// Calls f on every sphere after `s` in its bin and the bins around, each once.
  template <class F>
  void for_each_near(std::size_t s, F f) const {
    std::array<int, 3> low, high;
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = count_[k] < kFewBins ? 0 : bin_[s][k] - 1;
      high[k] = count_[k] < kFewBins ? count_[k] - 1 : bin_[s][k] + 1;
    }
    for (int x = low[0]; x <= high[0]; ++x)
      for (int y = low[1]; y <= high[1]; ++y)
        for (int z = low[2]; z <= high[2]; ++z)
          for (int o = first_[index({wrap(x, 0), wrap(y, 1), wrap(z, 2)})]; o >= 0;
               o = next_[static_cast<std::size_t>(o)])
            if (static_cast<std::size_t>(o) > s) f(static_cast<std::size_t>(o));
  }

 private:
  int wrap(int p, std::size_t k) const { return (p + count_[k]) % count_[k]; }
  std::size_t index(const std::array<int, 3>& p) const {
    return static_cast<std::size_t>((p[0] * count_[1] + p[1]) * count_[2] + p[2]);
  }
  std::array<int, 3> count_{};
  std::vector<std::array<int, 3>> bin_;
  std::vector<int> first_, next_;
};

/// The nearest image of sphere j as seen from i, and its gap. Throws when it is further away than a shift can say.
CompactPair nearest(const CompactArrays& a, const Row3& inverse_H, std::size_t i, std::size_t j, double& gap) {
  const Row3& H = a.header->H;
  const CompactSphere &p = a.spheres[i], &q = a.spheres[j];
  std::array<double, 3> d = {q.x[0] - p.x[0], q.x[1] - p.x[1], q.x[2] - p.x[2]};
  std::array<double, 3> shift;
  for (std::size_t k = 0; k < 3; ++k)
    shift[k] = -std::nearbyint(inverse_H[3 * k] * d[0] + inverse_H[3 * k + 1] * d[1] + inverse_H[3 * k + 2] * d[2]);
  for (std::size_t k = 0; k < 3; ++k) {
    if (!(std::abs(shift[k]) <= kMaxShift))
      throw std::runtime_error("A sphere has left its cell far behind: its velocity makes no sense.");
    d[k] += H[3 * k] * shift[0] + H[3 * k + 1] * shift[1] + H[3 * k + 2] * shift[2];
  }
  gap = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) - p.radius - q.radius;
  return {static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(j),
          pack_shift(static_cast<int>(shift[0]), static_cast<int>(shift[1]), static_cast<int>(shift[2])), 0.0F};
}

/// All pairs with a gap below the skin that are no contacts.
std::vector<CompactPair> near_pairs(const CompactArrays& a, const Row3& inverse_H, const Bins& bins, double skin) {
  const CompactHeader& h = *a.header;
  std::vector<CompactPair> pairs;
  std::vector<std::uint32_t> partner_of(h.spheres, 0);  // i + 1 where j touches i
  std::uint32_t contact = 0;
  for (std::uint32_t i = 0; i < h.spheres; ++i) {
    for (; contact < h.contacts && a.i[contact] == i; ++contact) partner_of[a.j[contact]] = i + 1;
    bins.for_each_near(i, [&](std::size_t j) {
      if (partner_of[j] == i + 1) return;
      double gap;
      CompactPair p = nearest(a, inverse_H, i, j, gap);
      if (gap >= skin) return;
      p.gap = std::nextafterf(static_cast<float>(gap), -1.0F);
      pairs.push_back(p);
    });
  }
  std::sort(pairs.begin(), pairs.end(), [](const CompactPair& p, const CompactPair& q) {
    return p.gap != q.gap ? p.gap > q.gap : p.i != q.i ? p.i < q.i : p.j < q.j;
  });
  return pairs;
}

}  // namespace

void make_list(CompactBlock& block) {
  const CompactHeader& h = block.header();
  const Row3 inverse_H = inverse(h.H);
  const std::array<double, 3> width = widths(inverse_H);
  const double largest = 2 * h.max_radius, skin = std::min(kSkin * h.min_radius, 0.99 * room(h));
  if (!(skin > 1e-3 * h.min_radius))
    throw std::runtime_error(
        "The cell has become too narrow for its largest grains, which could touch one another twice: use more grains "
        "(ve.spheres) for this distortion.");
  const Bins bins(block.arrays(), inverse_H, width, largest + skin);
  const std::vector<CompactPair> pairs = near_pairs(block.arrays(), inverse_H, bins, skin);
  if (pairs.size() > h.pair_capacity) block.grow(0, pairs.size() + pairs.size() / 8 + 64);
  const CompactArrays& a = block.arrays();
  std::copy(pairs.begin(), pairs.end(), a.pairs);
  a.header->pairs = static_cast<std::uint32_t>(pairs.size());
  a.header->skin = skin;
  a.header->list_H = a.header->H;
  for (std::size_t s = 0; s < a.header->spheres; ++s)
    for (std::size_t k = 0; k < 3; ++k) a.list_x[k][s] = a.spheres[s].x[k];
}

}  // namespace femxdem
