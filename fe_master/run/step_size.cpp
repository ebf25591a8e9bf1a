#include "step_size.hpp"

#include <algorithm>

namespace femxdem {
namespace {

constexpr double kRoundOff = 1e-9;  // of the way

}  // namespace

bool StepSize::done(double at) const { return !(at < end_ * (1 - kRoundOff)); }

double StepSize::next(double at) {
  const double left = end_ - at;
  last_ = at + size_ > end_ * (1 - kRoundOff);
  tried_ = last_ ? left : left < 1.5 * size_ ? 0.5 * left : size_;
  return tried_;
}

void StepSize::accepted(bool quick) {
  if (quick && !last_) size_ = std::min(tried_ * limits_.growth, limits_.largest);
}

}  // namespace femxdem
