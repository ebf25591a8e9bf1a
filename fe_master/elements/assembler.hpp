#pragma once

#include <Eigen/Sparse>
#include <span>
#include <vector>

#include "formulation.hpp"

namespace femxdem {

using SparseMatrix = Eigen::SparseMatrix<double>;

/// Scatters element vectors and matrices into the system of the free unknowns; the pattern is found once.
class Assembler {
 public:
  /// prescribed: unknowns that are not free, ascending.
  Assembler(const Formulation& formulation, const std::vector<int>& prescribed);

  /// Free unknowns, ascending: equation i of the system is unknown free()[i].
  const std::vector<int>& free() const { return free_; }
  /// Internal force of all unknowns from the Cauchy stresses of all points [N per thickness; N].
  Eigen::VectorXd force(const Configuration& at, std::span<const Tensor2> stress) const;
  /// What the constraints add on the right-hand side of a correction, all unknowns; penalty [Pa].
  Eigen::VectorXd constraint_force(const Eigen::VectorXd& x, double penalty) const;
  /// Matrix of the free unknowns. `change` (all unknowns): known changes of the prescribed ones, whose product with
  /// the matrix is subtracted from `rhs` (free unknowns).
  const SparseMatrix& matrix(const Linearisation& at, const Eigen::VectorXd& change, Eigen::VectorXd& rhs);

 private:
  const Formulation& formulation_;
  std::vector<int> free_;
  std::vector<int> equation_;             // of an unknown, -1 where it is prescribed
  std::vector<std::vector<int>> dofs_;    // of each element
  std::vector<std::vector<int>> places_;  // of each element's entries in the values of the matrix, -1: none
  SparseMatrix matrix_;
};

}  // namespace femxdem
