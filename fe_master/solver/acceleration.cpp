#include "acceleration.hpp"

#include <algorithm>

namespace femxdem {
namespace {

constexpr int kMostTries = 3;

Eigen::MatrixXd columns(const std::deque<Eigen::VectorXd>& vectors) {
  Eigen::MatrixXd M(vectors.front().size(), static_cast<Eigen::Index>(vectors.size()));
  for (std::size_t j = 0; j < vectors.size(); ++j) M.col(static_cast<Eigen::Index>(j)) = vectors[j];
  return M;
}

}  // namespace

AndersonAcceleration::AndersonAcceleration(int depth, double truncation, Eigen::VectorXd weights)
    : depth_(static_cast<std::size_t>(depth)), truncation_(truncation), weights_(std::move(weights)) {}

Eigen::VectorXd AndersonAcceleration::change(const Eigen::VectorXd& z, const Eigen::VectorXd& d) {
  if (z_.size() > 0 && depth_ > 0) {
    dz_.push_front(z - z_);
    dd_.push_front(d - d_);
  }
  z_ = z;
  d_ = d;
  if (dz_.size() > depth_) {
    dz_.pop_back();
    dd_.pop_back();
  }
  while (!dd_.empty()) {
    // The newest column comes first, so that leading columns are kept when the last are dropped.
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(weights_.asDiagonal() * columns(dd_));
    const Eigen::VectorXd diagonal = qr.matrixQR().diagonal().cwiseAbs();
    if (diagonal.minCoeff() > truncation_ * diagonal.maxCoeff()) {
      const Eigen::VectorXd gamma = qr.solve(weights_.cwiseProduct(d));
      return d - (columns(dz_) + columns(dd_)) * gamma;
    }
    dz_.pop_back();
    dd_.pop_back();
  }
  return d;
}

void LineSearch::start(double r0) {
  r0_ = r0;
  fraction_ = 1;
  tries_ = 0;
  started_ = true;
}

bool LineSearch::rejects(double residual) {
  if (!started_ || residual <= growth_ * r0_ || tries_ == kMostTries) return false;
  ++tries_;
  const double ratio = residual * residual / (r0_ * r0_);
  const double parabola = fraction_ / (ratio - 1 + 2 * fraction_);
  fraction_ *= std::clamp(parabola, 0.1, 0.5);
  return true;
}

}  // namespace femxdem
