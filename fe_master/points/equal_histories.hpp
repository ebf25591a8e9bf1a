#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "tensor.hpp"

namespace femxdem {

/// Volume elements follow the stretch up to this: points whose histories differ by round-off alone then do the same to
/// the bit.
inline constexpr double kQuantum = 1.0 / (1LL << 46);
Tensor2 quantised(const Tensor2& U);

/// Which points have had the same history so far: the same start, and stretches equal up to kQuantum ever since.
class EqualHistories {
 public:
  /// Points with equal numbers have an equal start.
  explicit EqualHistories(std::span<const int> starts) : committed_(starts.begin(), starts.end()) {}

  /// A trial from the committed histories; returns how many different ones it makes.
  std::size_t trial(std::span<const Tensor2> F);
  /// The last trial belongs to the histories.
  void commit() { committed_ = trial_; }
  /// Of each point the number of its committed one.
  const std::vector<int>& committed() const { return committed_; }

 private:
  std::vector<int> committed_, trial_;  ///< the number of each point's history
};

}  // namespace femxdem
