#pragma once

namespace femxdem {

/// How steps are cut and grown.
struct StepLimits {
  double first = 1;     ///< the first step tried
  double least = 0;     ///< below it nothing is tried any more
  double largest = 1;   ///< a grown step is at most this
  double growth = 1.3;  ///< factor after a quick step
  double cut = 0.5;     ///< factor after a failure
};

/// The size of the next step on the way to an end: a pure rule, without clock or files.
class StepSize {
 public:
  StepSize(const StepLimits& limits, double end) : limits_(limits), end_(end), size_(limits.first) {}

  /// Whether the way is done, up to round-off.
  bool done(double at) const;
  /// The step to try from `at`: the last one ends exactly at the end, and a step that would leave less than half of
  /// itself is half of what is left (a tiny last step is a hold for volume elements, whose stress relaxes in it).
  double next(double at);
  /// The step tried was taken; `quick`: the next one may be longer.
  void accepted(bool quick);
  /// The step tried has failed.
  void rejected() { size_ = tried_ * limits_.cut; }
  /// It has failed for a reason that is gone: the same again.
  void again() { size_ = tried_; }
  /// No step is left to try.
  bool exhausted() const { return size_ < limits_.least; }

  double size() const { return size_; }         ///< of the next step, for a checkpoint
  void set_size(double size) { size_ = size; }  ///< and back

 private:
  StepLimits limits_;
  double end_;
  double size_;
  double tried_ = 0;
  bool last_ = false;  // the step tried goes to the end
};

}  // namespace femxdem
