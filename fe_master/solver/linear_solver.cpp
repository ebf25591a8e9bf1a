#include "linear_solver.hpp"

#include <sys/mman.h>

#include <Eigen/CholmodSupport>
#include <Eigen/UmfPackSupport>
#include <new>

namespace femxdem {

namespace {

/// OpenBLAS 0.3.21 takes a buffer at its first call and keeps it; where the system refuses the memory it asks again,
/// for ever. Throws std::bad_alloc.
void require_room_for_blas() {
  static const bool there_is = [] {
    constexpr std::size_t kBuffer = std::size_t{129} << 20;  // [byte]
    void* room = mmap(nullptr, kBuffer, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (room == MAP_FAILED) throw std::bad_alloc();
    return munmap(room, kBuffer) == 0;
  }();
  static_cast<void>(there_is);
}

}  // namespace

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
  require_room_for_blas();
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
