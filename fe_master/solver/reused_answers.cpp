#include "reused_answers.hpp"

namespace femxdem {

void ReusedAnswers::begin_step() {
  last_.clear();
  misfit_ = {};
  stopped_ = false;
}

bool ReusedAnswers::near(std::size_t point, const Tensor2& F) const {
  if (!F.allFinite() || F.determinant() <= 0) return false;
  const Tensor2 U = polar_decomposition(F).U, last = polar_decomposition(last_[point]).U;
  return (U - last).norm() < below_ * (last - polar_decomposition(state_[point]).U).norm();
}

std::vector<Tensor2> ReusedAnswers::asked(std::span<const Tensor2> F) {
  std::vector<Tensor2> asked(F.begin(), F.end());
  const bool reuse = below_ > 0 && !stopped_ && !last_.empty();
  for (std::size_t p = 0; reuse && p < F.size(); ++p) {
    if (near(p, F[p])) asked[p] = last_[p];
  }
  last_ = asked;
  return asked;
}

void ReusedAnswers::answer(std::span<const Tensor2> F, std::span<Response> responses, const PointOperators& operators) {
  count_ = 0;
  unmoved_.clear();
  for (std::size_t p = 0; below_ > 0 && p < F.size(); ++p) {
    Tensor2& stress = responses[p].stress;
    unmoved_.push_back(stress);
    if (F[p] == last_[p]) continue;
    const Tensor2 turn = polar_decomposition(F[p]).R * polar_decomposition(last_[p]).R.transpose();
    unmoved_.back() = rotate(stress, turn);
    stress = operators.predict(p, F[p], last_[p], stress);
    ++count_;
  }
}

void ReusedAnswers::judge(const Misfit& misfit) {
  misfit_.missed += misfit.missed;
  misfit_.expected += misfit.expected;
}

void ReusedAnswers::save(NamedArrays& arrays) const {
  if (below_ > 0) add_tensors(arrays, "reuse.F", state_);
}

void ReusedAnswers::load(const NamedArrays& arrays) {
  if (below_ > 0) find_tensors(arrays, "reuse.F", state_);
}

}  // namespace femxdem
