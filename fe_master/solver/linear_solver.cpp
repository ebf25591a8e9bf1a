#include "linear_solver.hpp"

#include <Eigen/CholmodSupport>
#include <Eigen/UmfPackSupport>

namespace femxdem {

struct LinearSolver::Factors {
  Eigen::CholmodSupernodalLLT<SparseMatrix, Eigen::Lower> cholesky;
  Eigen::UmfPackLU<SparseMatrix> lu;
  bool cholesky_analysed = false;
  bool lu_analysed = false;
  bool use_cholesky = false;
};

LinearSolver::LinearSolver() : factors_(std::make_unique<Factors>()) { factors_->cholesky.cholmod().print = 0; }

LinearSolver::~LinearSolver() = default;

bool LinearSolver::factorise(const SparseMatrix& A, bool symmetric) {
  Factors& f = *factors_;
  f.use_cholesky = false;
  if (A.rows() == 0) return true;  // every unknown is prescribed
  if (symmetric) {
    if (!f.cholesky_analysed) f.cholesky.analyzePattern(A);
    f.cholesky_analysed = true;
    f.cholesky.factorize(A);
    f.use_cholesky = f.cholesky.info() == Eigen::Success;
    if (f.use_cholesky) return true;
  }
  if (!f.lu_analysed) f.lu.analyzePattern(A);
  f.lu_analysed = true;
  f.lu.factorize(A);
  return f.lu.info() == Eigen::Success;
}

Eigen::VectorXd LinearSolver::solve(const Eigen::VectorXd& b) const {
  if (b.size() == 0) return b;
  return factors_->use_cholesky ? Eigen::VectorXd(factors_->cholesky.solve(b)) : Eigen::VectorXd(factors_->lu.solve(b));
}

}  // namespace femxdem
