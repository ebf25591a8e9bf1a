#include "assembler.hpp"

#include <algorithm>

namespace femxdem {

Assembler::Assembler(const Formulation& formulation, const std::vector<int>& prescribed)
    : formulation_(formulation), equation_(formulation.unknowns(), 0) {
  for (const int dof : prescribed) equation_[dof] = -1;
  for (int dof = 0; dof < formulation.unknowns(); ++dof) {
    if (equation_[dof] < 0) continue;
    equation_[dof] = static_cast<int>(free_.size());
    free_.push_back(dof);
  }
  const int n = static_cast<int>(free_.size());
  std::vector<Eigen::Triplet<double>> entries;
  for (std::size_t e = 0; e < formulation.mesh().elements.size(); ++e) {
    dofs_.push_back(formulation.dofs(static_cast<int>(e)));
    for (const int i : dofs_.back()) {
      for (const int j : dofs_.back()) {
        if (equation_[i] >= 0 && equation_[j] >= 0) entries.emplace_back(equation_[i], equation_[j], 1.0);
      }
    }
  }
  matrix_.resize(n, n);
  matrix_.setFromTriplets(entries.begin(), entries.end());
  matrix_.makeCompressed();
  for (const auto& dofs : dofs_) {
    std::vector<int> places;
    for (const int j : dofs) {
      for (const int i : dofs) {
        if (equation_[i] < 0 || equation_[j] < 0) {
          places.push_back(-1);
          continue;
        }
        const int* begin = matrix_.innerIndexPtr() + matrix_.outerIndexPtr()[equation_[j]];
        const int* end = matrix_.innerIndexPtr() + matrix_.outerIndexPtr()[equation_[j] + 1];
        places.push_back(static_cast<int>(std::lower_bound(begin, end, equation_[i]) - matrix_.innerIndexPtr()));
      }
    }
    places_.push_back(std::move(places));
  }
}

Eigen::VectorXd Assembler::force(const Configuration& at, std::span<const Tensor2> stress) const {
  Eigen::VectorXd f = Eigen::VectorXd::Zero(formulation_.unknowns());
  for (std::size_t e = 0; e < dofs_.size(); ++e) {
    const Eigen::VectorXd f_e = formulation_.force(static_cast<int>(e), at, stress);
    for (Eigen::Index i = 0; i < f_e.size(); ++i) f[dofs_[e][i]] += f_e[i];
  }
  return f;
}

Eigen::VectorXd Assembler::constraint_force(const Eigen::VectorXd& x, double penalty) const {
  Eigen::VectorXd f = Eigen::VectorXd::Zero(formulation_.unknowns());
  for (std::size_t e = 0; e < dofs_.size(); ++e) {
    const Eigen::VectorXd f_e = formulation_.constraint_force(static_cast<int>(e), x, penalty);
    for (Eigen::Index i = 0; i < f_e.size(); ++i) f[dofs_[e][i]] += f_e[i];
  }
  return f;
}

const SparseMatrix& Assembler::matrix(const Linearisation& at, const Eigen::VectorXd& change, Eigen::VectorXd& rhs) {
  std::fill_n(matrix_.valuePtr(), matrix_.nonZeros(), 0.0);
  for (std::size_t e = 0; e < dofs_.size(); ++e) {
    const Eigen::MatrixXd K = formulation_.matrix(static_cast<int>(e), at);
    const int* place = places_[e].data();
    const int n = static_cast<int>(dofs_[e].size());
    for (int j = 0; j < n; ++j) {
      const int dof = dofs_[e][j];
      const double known = equation_[dof] < 0 ? change[dof] : 0;
      for (int i = 0; i < n; ++i, ++place) {
        if (*place >= 0) matrix_.valuePtr()[*place] += K(i, j);
        if (known != 0 && equation_[dofs_[e][i]] >= 0) rhs[equation_[dofs_[e][i]]] -= K(i, j) * known;
      }
    }
  }
  return matrix_;
}

}  // namespace femxdem
