#pragma once

#include "analytic_laws.hpp"

namespace femxdem {

/// Material points that follow laws in closed form; parameters may differ from point to point (weak regions).
class AnalyticPoints : public MaterialPoints {
 public:
  /// One law for each point. Throws UserError when a law's parameters are out of bounds.
  explicit AnalyticPoints(std::vector<AnalyticLaw> laws);

  std::size_t size() const override { return laws_.size(); }
  std::vector<Response> evaluate(std::span<const Tensor2> F, Operator wanted) override;
  void commit() override { committed_ = trial_; }
  void save_each(const TakeState& take) override;
  /// Throws UserError when the states are not those of as many points with laws in closed form.
  void load_each(const StateSource& states) override;

 private:
  std::vector<AnalyticLaw> laws_;
  std::vector<LawState> committed_;
  std::vector<LawState> trial_;
};

}  // namespace femxdem
