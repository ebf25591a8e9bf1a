#pragma once

#include <cassert>
#include <functional>
#include <random>

#include "analytic_points.hpp"

namespace femxdem {

/// Laws in closed form that answer as volume elements with ve.answer = "mean" do: with the mean of the stress over the
/// way from the committed F to the trial's, taken in the frame of the material and turned to that of the end. Weight 1
/// + late (2 t / T - 1), late = 6 theta - 3. theta = 1: the stress of the end. noise: of the
/// stress, by which it jumps from one F to any other.
class MeanPoints : public MaterialPoints {
 public:
  MeanPoints(std::vector<AnalyticLaw> laws, double theta, double noise = 0)
      : laws_(std::move(laws)), theta_(theta), noise_(noise), late_((6 * theta - 3) / (1 + 2.0 / (kParts * kParts))) {
    for (const AnalyticLaw& law : laws_) committed_.push_back(initial_state(law));
    trial_ = committed_;
  }

  std::size_t size() const override { return laws_.size(); }
  std::vector<Response> evaluate(std::span<const Tensor2> F, Operator wanted) override {
    std::vector<Response> responses;
    for (std::size_t p = 0; p < size(); ++p) responses.push_back(answer(p, F[p], wanted));
    return responses;
  }
  void commit() override { committed_ = trial_; }
  void save_each(const TakeState&) override {}
  void load_each(const StateSource&) override {}

  const LawState& committed(std::size_t point) const { return committed_[point]; }
  void set_committed(const MeanPoints& other) { committed_ = trial_ = other.committed_; }

 private:
  static constexpr int kParts = 16;

  Response answer(std::size_t p, const Tensor2& F, Operator wanted) {
    const Tensor2 start = committed_[p].F;
    Tensor2 sum = 0.5 / kParts * (1 - late_) * unrotated(committed_[p]);
    LawState state = committed_[p];
    Response response;
    for (int k = 1; k <= kParts; ++k) {
      const LawState before = state;
      const double done = static_cast<double>(k) / kParts;
      response = update(laws_[p], before, Tensor2(start + done * (F - start)), wanted, state);
      if (response.failure) return response;
      sum += (k == kParts ? 0.5 : 1.0) / kParts * (1 + late_ * (2 * done - 1)) * unrotated(state);
    }
    trial_[p] = state;
    if (theta_ < 1) response.stress = rotate(sum, polar_decomposition(F).R);
    if (noise_ > 0) response.stress += jump(F) * noise_ * response.stress.norm();
    const Tensor2 end = unrotated(state);
    response.report["end_stress_xx"] = end(0, 0), response.report["end_stress_yy"] = end(1, 1);
    response.report["end_stress_zz"] = end(2, 2), response.report["end_stress_xy"] = end(0, 1);
    response.report["end_stress_yz"] = end(1, 2), response.report["end_stress_zx"] = end(2, 0);
    return response;
  }
  /// A symmetric tensor of random numbers between -1 and 1, other ones for every F.
  static Tensor2 jump(const Tensor2& F) {
    std::size_t bits = 0;
    for (const double value : F.reshaped()) bits = 31 * bits + std::hash<double>{}(value);
    std::mt19937_64 generator(bits);
    const Tensor2 random = Tensor2::NullaryExpr([&] { return 2.0 * static_cast<double>(generator()) / 0x1p64 - 1; });
    return 0.5 * (random + random.transpose());
  }
  static Tensor2 unrotated(const LawState& state) {
    return rotate(state.stress, Tensor2(polar_decomposition(state.F).R.transpose()));
  }

  std::vector<AnalyticLaw> laws_;
  double theta_, noise_, late_;
  std::vector<LawState> committed_, trial_;
};

}  // namespace femxdem
