#include "convergence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace femxdem {
namespace {

constexpr double kDivergence = 1e3;  // growth over the first residual and over the tolerance
constexpr double kSame = 1e-9;       // relative difference of residuals that repeat themselves
constexpr std::size_t kLongestCycle = 4;
constexpr std::size_t kWindow = 6;         // last residuals that are looked at for a verdict
constexpr double kForgottenInAStep = 0.2;  // of what is known about contraction and noise
constexpr double kNear = 4;                // times the tolerance: residuals from which contraction is learned
constexpr double kGrowth = 1.5;            // a residual above this times the one before is no correction's
constexpr double kProgress = 0.7;          // a least residual above this times the earlier one is no progress

bool same(double a, double b) { return std::abs(a - b) <= kSame * std::max(a, b); }

/// Length of the cycle at the end of the residuals, seen twice over; 0: none.
std::size_t cycle(const std::vector<double>& r) {
  for (std::size_t length = 2; length <= kLongestCycle && 2 * length + 1 <= r.size(); ++length) {
    const auto end = r.end();
    const auto n = static_cast<std::ptrdiff_t>(length);
    if (std::equal(end - n, end, end - 2 * n, same) && same(*(end - 2 * n - 1), *(end - n - 1))) return length;
  }
  return 0;
}

}  // namespace

double ResidualHistory::least() const {
  return residuals_.empty() ? std::numeric_limits<double>::infinity()
                            : *std::min_element(residuals_.begin(), residuals_.end());
}

std::string ResidualHistory::hopeless(bool memoryless) const {
  const double last = residuals_.back();
  if (!std::isfinite(last)) return "diverges: the residual is not finite";
  if (last > kDivergence * std::max(residuals_.front(), tolerance_)) {
    return fmt::format("diverges: residual {:.1e} after {:.1e}", last, least());
  }
  if (const std::size_t length = memoryless ? cycle(residuals_) : 0; length > 0) {
    return fmt::format("oscillates: a cycle of {} iterations at residuals from {:.1e}", length,
                       *std::min_element(residuals_.end() - static_cast<std::ptrdiff_t>(length), residuals_.end()));
  }
  return "";
}

std::string ResidualHistory::verdict() const {
  const std::string spent =
      fmt::format("in {} iterations: least residual {:.1e}, tolerance {:.1e}", residuals_.size(), least(), tolerance_);
  const std::size_t window = std::min(kWindow, residuals_.size() - 1);
  const auto recent = residuals_.end() - static_cast<std::ptrdiff_t>(window);
  if (window < 3) return "does not converge " + spent;
  const double earlier = *std::min_element(residuals_.begin(), recent);
  const double now = *std::min_element(recent, residuals_.end());
  int turns = 0;
  for (auto r = recent + 1; r + 1 != residuals_.end(); ++r) turns += (r[0] > r[-1]) != (r[1] > r[0]);
  const bool progress = now <= kProgress * earlier;
  const double largest = *std::max_element(recent, residuals_.end());
  if (!progress && turns >= static_cast<int>(window) / 2 && largest > 2 * now) return "oscillates " + spent;
  if (residuals_.back() > 10 * least()) return "diverges " + spent;
  if (progress) return "converges too slowly " + spent;
  return "stagnates " + spent;
}

bool Contraction::near(double residual) const { return residual > 0 && residual <= kNear * tolerance_; }

void Contraction::begin_step() {
  last_ = 0;
  seen_ *= 1 - kForgottenInAStep;
  for (double& sum : sums_) sum *= 1 - kForgottenInAStep;
}

void Contraction::add(double residual) {
  const bool grows = last_ > 0 && residual > kGrowth * last_;
  if (grows) {
    seen_ = 0;
    sums_ = {};
  } else if (near(last_)) {
    const double x = std::pow(last_ / tolerance_, 2), y = std::pow(residual / tolerance_, 2), w = std::pow(1 + x, -2);
    const std::array<double, 5> terms = {1, x, y, x * x, x * y};
    for (std::size_t i = 0; i < terms.size(); ++i) sums_[i] += w * terms[i];
    seen_ += 1;
  }
  last_ = residual;
}

Contraction::Squares Contraction::fitted() const {
  if (seen_ < 1) return {};
  const auto [w, x, y, xx, xy] = sums_;
  const double spread = w * xx - x * x;
  const double slope = w * xy - x * y, offset = xx * y - x * xy;  // times spread
  if (spread <= 1e-9 * w * xx || offset <= 0) return {xy / xx, 0};
  return slope <= 0 ? Squares{0, y / w} : Squares{slope / spread, offset / spread};
}

std::optional<double> Contraction::after(double residual) const {
  if (seen_ < 1 || !near(residual)) return std::nullopt;
  const Squares squares = fitted();
  return std::hypot(std::sqrt(squares.contraction) * residual, std::sqrt(squares.noise) * tolerance_);
}

double Contraction::noise() const { return std::sqrt(fitted().noise) * tolerance_; }

double Contraction::tolerance() const {
  return over_noise_ > 0 ? std::clamp(over_noise_ * noise(), tolerance_, kMostRaised * tolerance_) : tolerance_;
}

void Contraction::save(NamedArrays& arrays) const {
  std::vector<double> values(sums_.begin(), sums_.end());
  values.push_back(seen_);
  arrays.emplace_back("solver.contraction", std::move(values));
}

void Contraction::load(const NamedArrays& arrays) {
  const auto& values = find_array(arrays, "solver.contraction");
  seen_ = values.at(sums_.size());
  std::copy_n(values.begin(), sums_.size(), sums_.begin());
}

}  // namespace femxdem
