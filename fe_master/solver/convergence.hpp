#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "named_arrays.hpp"

namespace femxdem {

/// Residuals of a step's iterations, and what they say about the step.
class ResidualHistory {
 public:
  explicit ResidualHistory(double tolerance) : tolerance_(tolerance) {}

  void add(double residual) { residuals_.push_back(residual); }
  double least() const;
  /// Why further iterations are of no use, or nothing: the residual is not finite, it has grown beyond a thousand times
  /// the first and the tolerance, or (`memoryless` operator: equal iterates, equal corrections) it repeats itself.
  std::string hopeless(bool memoryless) const;
  /// What happened in the iterations that were spent: diverges, oscillates, stagnates, or falls too slowly.
  std::string verdict() const;

 private:
  double tolerance_;
  std::vector<double> residuals_;
};

/// What whole corrections leave of a residual, as the last steps have shown it:
///   r_{k+1}^2 = a^2 r_k^2 + noise^2,
/// a: their contraction; noise: what is left however small the residual was, because volume elements answer
/// neighbouring strains with jumps. Fitted by least squares (a^2, noise^2 >= 0, errors of r_{k+1}^2 as 1 + r_k^2 /
/// tolerance^2) to the residuals from which a correction may end a step, a fifth of them forgotten from step to step. A
/// residual that grows by more than a half is no correction's: all is forgotten.
class Contraction {
 public:
  /// over_noise: the tolerance is raised to so many times the noise, at most to kMostRaised times itself; 0: never.
  Contraction(double tolerance, double over_noise) : tolerance_(tolerance), over_noise_(over_noise) {}
  static constexpr double kMostRaised = 2;

  void begin_step();
  void add(double residual);
  /// The residual that is to be expected after one more correction; nothing where too little was seen lately, or
  /// nothing of so large residuals.
  std::optional<double> after(double residual) const;
  /// 0 where too little was seen lately [-].
  double noise() const;
  /// That of the case, or what the noise raises it to [-].
  double tolerance() const;

  void save(NamedArrays& arrays) const;
  void load(const NamedArrays& arrays);

 private:
  struct Squares {
    double contraction = 0, noise = 0;  // noise over tolerance
  };
  bool near(double residual) const;
  Squares fitted() const;

  double tolerance_, over_noise_;
  double last_ = 0;               // residual of this step; 0: none
  double seen_ = 0;               // residuals, with what is left of their weight
  std::array<double, 5> sums_{};  // of w, w x, w y, w x^2, w x y so weighed; x, y: r_k^2, r_{k+1}^2 over tolerance^2
};

}  // namespace femxdem
