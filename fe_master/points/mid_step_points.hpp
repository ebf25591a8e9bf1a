#pragma once

#include "material_points.hpp"

namespace femxdem {

/// Points whose stress belongs to a fraction theta of the step: the mean over their trials (ve.answer = "mean"). Who
/// asks names the deformation gradient F of that moment; the points are strained beyond it, from F_n at the step's
/// start to
///   F_end = F_n + (F - F_n) / theta,
/// and their stress, which comes in the frame of F_end = R_end U_end, is turned to that of F: R R_end^T. So residual
/// and operators see one F and the stress of that F, to second order in the step. What is asked of them there leaves
/// (1 - theta) of what the start of the step lacked, so that an elastic point has nothing of it at the end; asked for
/// all of it, they would overshoot by (1 - theta) / theta, step after step. theta = 1: as if it were not there.
class MidStepPoints : public MaterialPoints {
 public:
  /// points is kept by reference. theta: in (0, 1].
  MidStepPoints(MaterialPoints& points, double theta) : points_(points), theta_(theta) {}

  double theta() const { return theta_; }
  /// What is at the end of the step from what is at its start and what is at theta; `at` itself for theta = 1.
  template <class Quantity>
  Quantity end(const Quantity& start, const Quantity& at) const {
    return theta_ == 1 ? at : Quantity(start + (at - start) / theta_);
  }
  /// The reverse.
  template <class Quantity>
  Quantity within(const Quantity& start, const Quantity& end) const {
    return theta_ == 1 ? end : Quantity(start + theta_ * (end - start));
  }
  /// Stresses at the end of the trials that gave these answers, of deformation gradients F there [Pa].
  static std::vector<Tensor2> end_stresses(std::span<const Tensor2> F, std::span<const Response> responses);
  /// Deformation gradients (size()) at the start of the next step.
  void start_from(std::span<const Tensor2> F) { start_.assign(F.begin(), F.end()); }

  std::size_t size() const override { return points_.size(); }
  std::size_t distinct() const override { return points_.distinct(); }
  std::vector<int> histories() const override { return points_.histories(); }
  void begin_step() override { points_.begin_step(); }
  std::vector<Response> evaluate(std::span<const Tensor2> F, Operator wanted) override;
  void commit() override { points_.commit(); }
  std::vector<PointReport> reports() override { return points_.reports(); }
  void save_each(const TakeState& take) override { points_.save_each(take); }
  void load_each(const StateSource& states) override { points_.load_each(states); }

 private:
  MaterialPoints& points_;
  double theta_;
  std::vector<Tensor2> start_;
};

}  // namespace femxdem
