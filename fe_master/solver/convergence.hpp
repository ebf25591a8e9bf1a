#pragma once

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

/// What a whole correction leaves of a residual, as the last steps have shown it: the root mean square of r_{k+1} / r_k
/// over the residuals from which a correction may end a step, a fifth of it forgotten from step to step.
class Contraction {
 public:
  explicit Contraction(double tolerance) : tolerance_(tolerance) {}

  void begin_step();
  void add(double residual);
  /// The residual that is to be expected after one more correction; nothing where too little was seen lately, or
  /// nothing of so large residuals.
  std::optional<double> after(double residual) const;

  void save(NamedArrays& arrays) const;
  void load(const NamedArrays& arrays);

 private:
  bool near(double residual) const;

  double tolerance_;
  double last_ = 0;               // residual of this step; 0: none
  double seen_ = 0, ratio2_ = 0;  // residuals, with what is left of their weight; sum of (r_{k+1} / r_k)^2 so weighed
};

}  // namespace femxdem
