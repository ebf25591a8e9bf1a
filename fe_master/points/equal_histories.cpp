#include "equal_histories.hpp"

#include <array>
#include <cmath>
#include <map>
#include <utility>

namespace femxdem {

Tensor2 quantised(const Tensor2& U) {
  return U.unaryExpr([](double value) { return std::nearbyint(value / kQuantum) * kQuantum; });
}

std::size_t EqualHistories::trial(std::span<const Tensor2> F) {
  std::map<std::pair<int, std::array<double, 9>>, int> known;
  trial_.clear();
  for (std::size_t p = 0; p < F.size(); ++p) {
    std::array<double, 9> key{};
    if (F[p].allFinite() && F[p].determinant() > 0) {
      const Tensor2 followed = quantised(polar_decomposition(F[p]).U);
      std::copy_n(followed.data(), 9, key.begin());
    }
    trial_.push_back(known.try_emplace({committed_[p], key}, static_cast<int>(known.size())).first->second);
  }
  return known.size();
}

}  // namespace femxdem
