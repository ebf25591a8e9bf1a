#pragma once

#include <memory>

#include "assembler.hpp"

namespace femxdem {

/// Direct solver of one sparsity pattern: CHOLMOD for symmetric positive definite matrices, UMFPACK for the others.
/// The symbolic analysis is made once per kind, at the first use.
class LinearSolver {
 public:
  LinearSolver();
  ~LinearSolver();

  /// Factorises A (kept by reference for UMFPACK: it must live until the next call). `symmetric`: try CHOLMOD; a
  /// matrix that turns out not to be positive definite is given to UMFPACK. False when A is singular. Throws
  /// std::bad_alloc at the first call where there is no memory for OpenBLAS.
  bool factorise(const SparseMatrix& A, bool symmetric);
  /// Solution of the factorised system.
  Eigen::VectorXd solve(const Eigen::VectorXd& b) const;

 private:
  struct Factors;
  std::unique_ptr<Factors> factors_;
};

}  // namespace femxdem
