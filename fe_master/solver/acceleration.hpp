#pragma once

#include <Eigen/Dense>
#include <deque>

namespace femxdem {

/// Anderson mixing of type II of the corrections that an operator asks for (Anderson 1965; Walker and Ni 2011,
/// Eq. 2.2):
///   gamma = argmin | W (d_k - dD gamma) |,   change of z = d_k - (dZ + dD) gamma,
/// where the columns of dZ and dD are the differences of successive iterates z and corrections d. Depth 0: d_k itself.
class AndersonAcceleration {
 public:
  /// depth: columns remembered; truncation: the oldest ones are dropped until the triangular factor of W dD has no
  /// diagonal entry below this times the largest (10 x noise / tolerance is a sound value); weights: W, one a
  /// component of z.
  AndersonAcceleration(int depth, double truncation, Eigen::VectorXd weights);

  /// Change of z, from the correction d that the operator asks for at z.
  Eigen::VectorXd change(const Eigen::VectorXd& z, const Eigen::VectorXd& d);

 private:
  std::size_t depth_;
  double truncation_;
  Eigen::VectorXd weights_;
  Eigen::VectorXd z_, d_;  // of the last call
  std::deque<Eigen::VectorXd> dz_, dd_;
};

/// Backtracking along a change of the unknowns until the residual falls. Its square is interpolated by a parabola whose
/// slope at 0 is that of Newton's correction, -2 r0^2; a fraction is kept within 0.1 to 0.5 of the one before.
class LineSearch {
 public:
  /// growth: a residual up to this times the one at the start is taken.
  explicit LineSearch(double growth) : growth_(growth) {}

  /// Starts along a new change of the unknowns from the residual r0.
  void start(double r0);
  /// Whether the residual at the fraction tried is too large; the next fraction is then ready. At most three times.
  bool rejects(double residual);
  /// Fraction of the change to be tried.
  double fraction() const { return fraction_; }

 private:
  double growth_;
  double r0_ = 0;
  double fraction_ = 1;
  int tries_ = 0;
  bool started_ = false;
};

}  // namespace femxdem
