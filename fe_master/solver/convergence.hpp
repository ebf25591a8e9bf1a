#pragma once

#include <string>
#include <vector>

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

}  // namespace femxdem
