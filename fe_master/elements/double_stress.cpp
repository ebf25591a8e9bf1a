#include "double_stress.hpp"

#include <algorithm>
#include <unsupported/Eigen/AutoDiff>

namespace femxdem {
namespace {

using Jet = Eigen::AutoDiffScalar<Eigen::Matrix<double, 12, 1>>;  // 4 components of F, 8 of H

constexpr int triple(int i, int j, int k) { return 4 * i + 2 * j + k; }

template <typename S>
using Matrix2 = Eigen::Matrix<S, 2, 2>;
template <typename S>
using Vector8 = Eigen::Matrix<S, 8, 1>;

double root(double a) { return std::sqrt(a); }
Jet root(const Jet& a) {
  const double r = std::sqrt(a.value());
  return {r, a.derivatives() / (2 * r)};
}

template <typename S>
Matrix2<S> inverse_of(const Matrix2<S>& A) {
  const S det = A(0, 0) * A(1, 1) - A(0, 1) * A(1, 0);
  Matrix2<S> B;
  B(0, 0) = A(1, 1) / det;
  B(0, 1) = -A(0, 1) / det;
  B(1, 0) = -A(1, 0) / det;
  B(1, 1) = A(0, 0) / det;
  return B;
}

/// A_ia A_jb B_kc T_abc, one index after the other.
template <typename S>
Vector8<S> transform(const Vector8<S>& T, const Matrix2<S>& A, const Matrix2<S>& B) {
  Vector8<S> X, Y, Z;
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      for (int k = 0; k < 2; ++k) X[triple(i, j, k)] = S(A(i, 0) * T[triple(0, j, k)] + A(i, 1) * T[triple(1, j, k)]);
    }
  }
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      for (int k = 0; k < 2; ++k) Y[triple(i, j, k)] = S(A(j, 0) * X[triple(i, 0, k)] + A(j, 1) * X[triple(i, 1, k)]);
    }
  }
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      for (int k = 0; k < 2; ++k) Z[triple(i, j, k)] = S(B(k, 0) * Y[triple(i, j, 0)] + B(k, 1) * Y[triple(i, j, 1)]);
    }
  }
  return Z;
}

template <typename S>
struct Updated {
  Vector8<S> sigma, T;
};

template <typename S>
Updated<S> update(const DoubleStiffness& law, const Matrix2<S>& F, const Eigen::Matrix2d& F_n, const Vector8<S>& H,
                  const DoubleStress& sigma_n) {
  const Matrix2<S> I = Matrix2<S>::Identity();
  const Matrix2<S> F_n_inverse = F_n.inverse().template cast<S>();
  const Matrix2<S> F_step = F * F_n_inverse;
  Matrix2<S> to_mid = inverse_of<S>(Matrix2<S>(F_step + I));  // dx_n / dx_(n+1/2) = 2 (F_step + I)^-1
  for (int i = 0; i < 4; ++i) to_mid(i / 2, i % 2) *= S(2);
  const Matrix2<S> G = (F_step - I) * to_mid;  // d(Delta u) / dx_(n+1/2)
  const S a = S(0.25) * (G(0, 1) - G(1, 0));   // half the spin
  const S square = a * a + S(1);
  const S norm = root(square);
  Matrix2<S> Q_half;  // rotation by atan(a), half the step's
  Q_half(0, 0) = Q_half(1, 1) = S(1) / norm;
  Q_half(0, 1) = a / norm;
  Q_half(1, 0) = -Q_half(0, 1);
  const Matrix2<S> Q = Q_half * Q_half;

  const Matrix2<S> K_to_mid = F_n_inverse * to_mid;  // dX / dx_(n+1/2)
  const Vector8<S> h_mid = transform<S>(H, I, Matrix2<S>(K_to_mid.transpose()));
  const Vector8<S> increment = law.template cast<S>() * h_mid;
  Updated<S> result;
  result.sigma = transform<S>(sigma_n.template cast<S>(), Q, Q) + transform<S>(increment, Q_half, Q_half);
  const S J = F(0, 0) * F(1, 1) - F(0, 1) * F(1, 0);
  result.T = transform<S>(result.sigma, I, inverse_of<S>(F));
  for (int c = 0; c < 8; ++c) result.T[c] *= J;
  return result;
}

}  // namespace

DoubleStiffness one_parameter_law(double D) { return mindlin_law({D / 2, 0, 0, D / 2, -D / 2}); }

DoubleStiffness mindlin_law(const std::array<double, 5>& a) {
  const auto d = [](int i, int j) { return i == j ? 1.0 : 0.0; };
  DoubleStiffness law;
  for (int row = 0; row < 8; ++row) {
    const int p = row / 4, q = row / 2 % 2, r = row % 2;
    for (int column = 0; column < 8; ++column) {
      const int l = column / 4, m = column / 2 % 2, n = column % 2;
      law(row, column) =
          a[0] / 2 *
              (d(p, q) * (d(l, m) * d(r, n) + d(l, n) * d(r, m)) + d(p, r) * (d(l, m) * d(q, n) + d(l, n) * d(q, m))) +
          a[1] / 2 *
              (d(p, q) * d(r, l) * d(m, n) + d(q, r) * (d(l, m) * d(p, n) + d(l, n) * d(p, m)) +
               d(p, r) * d(q, l) * d(m, n)) +
          2 * a[2] * d(q, r) * d(p, l) * d(m, n) + a[3] * d(p, l) * (d(q, m) * d(r, n) + d(q, n) * d(r, m)) +
          a[4] / 2 *
              (d(r, l) * (d(p, m) * d(q, n) + d(p, n) * d(q, m)) + d(q, l) * (d(r, m) * d(p, n) + d(r, n) * d(p, m)));
    }
  }
  return law;
}

DoublePiola update_double_stress(const DoubleStiffness& law, const Eigen::Matrix2d& F, const Eigen::Matrix2d& F_n,
                                 const DoubleStress& H, const DoubleStress& sigma_n, bool derivatives) {
  DoublePiola result;
  if (!derivatives) {
    const auto updated = update<double>(law, F, F_n, H, sigma_n);
    result.sigma = updated.sigma;
    result.T = updated.T;
    result.dT_dF.setZero();
    const Eigen::Matrix2d F_inverse = F.inverse();
    DoubleStiffness push = DoubleStiffness::Zero();  // H_ijK -> H_ijK F^-1_Kk
    for (int ij = 0; ij < 4; ++ij) push.block<2, 2>(2 * ij, 2 * ij) = F_inverse.transpose();
    result.dT_dH = F.determinant() * push.transpose() * law * push;
    return result;
  }
  Matrix2<Jet> F_jet;
  for (int c = 0; c < 4; ++c) F_jet(c / 2, c % 2) = Jet(F(c / 2, c % 2), 12, c);
  Vector8<Jet> H_jet;
  for (int c = 0; c < 8; ++c) H_jet[c] = Jet(H[c], 12, 4 + c);
  const auto updated = update<Jet>(law, F_jet, F_n, H_jet, sigma_n);
  for (int c = 0; c < 8; ++c) {
    result.sigma[c] = updated.sigma[c].value();
    result.T[c] = updated.T[c].value();
    result.dT_dF.row(c) = updated.T[c].derivatives().head<4>().transpose();
    result.dT_dH.row(c) = updated.T[c].derivatives().tail<8>().transpose();
  }
  return result;
}

DoubleStiffness make_double_stiffness(const ElementParameters& e) {
  if (e.mindlin.empty()) return one_parameter_law(e.D);
  std::array<double, 5> a{};
  std::copy_n(e.mindlin.begin(), 5, a.begin());
  return mindlin_law(a);
}

}  // namespace femxdem
