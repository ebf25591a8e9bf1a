#include "learned_tangent.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace femxdem {
namespace {

constexpr std::array<std::pair<int, int>, 6> kMandel = {{{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}}};
/// Chosen by replaying the pairs of runs on cells of 1000 spheres (validation/quasi_static): what the next pair's
/// stress is missed by has a flat minimum in both.
constexpr double kForgotten = 0.04;    // of what is known, from step to step
constexpr double kLeastChange = 3e-3;  // scatter over a step's first change

double mandel_factor(int c) { return c < 3 ? 1 : std::sqrt(2.0); }

using Vector9 = Eigen::Matrix<double, 9, 1>;

Vector9 flat(const Tensor2& T) {
  Vector9 v;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) v[pair(i, j)] = T(i, j);
  }
  return v;
}

Tensor2 unflat(const Vector9& v) {
  Tensor2 T;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) T(i, j) = v[pair(i, j)];
  }
  return T;
}

/// Columns of dP/dF from dsigma(dF), P = J sigma F^-T: dP = J (dsigma + tr(h) sigma - sigma h^T) F^-T, h = dF F^-1.
template <typename StressChange>
Tensor4 piola_columns(const Tensor2& stress, const Tensor2& F, bool geometric, const StressChange& stress_change) {
  const Tensor2 F_inverse = F.inverse();
  const Tensor2 pull = F.determinant() * F_inverse.transpose();
  Tensor4 A;
  for (int k = 0; k < 3; ++k) {
    for (int L = 0; L < 3; ++L) {
      Tensor2 h = Tensor2::Zero();
      h.row(k) = F_inverse.row(L);
      Tensor2 change = stress_change(k, L, h);
      if (geometric) change += h.trace() * stress - stress * h.transpose();
      A.col(pair(k, L)) = flat(change * pull);
    }
  }
  return A;
}

}  // namespace

Tensor4 piola_tangent(const Tensor4& c, const Tensor2& stress, const Tensor2& F) {
  return piola_columns(stress, F, true, [&](int, int, const Tensor2& h) { return unflat(c * flat(h)); });
}

Tensor4 piola_elastic(const Tensor4& C, const Tensor2& F) {
  return piola_columns(Tensor2::Zero(), F, false, [&](int, int, const Tensor2& h) { return unflat(C * flat(h)); });
}

Tensor4 piola_corotational(const Tensor4& C, const Tensor2& stress, const Tensor2& F, const Tensor2& U_n) {
  const auto [R, U] = polar_decomposition(F);
  const Tensor2 s = R.transpose() * stress * R;
  const Tensor2 U_n_inverse = U_n.inverse();
  const Tensor2 spin_solver = (U.trace() * Tensor2::Identity() - U).inverse();
  return piola_columns(stress, F, true, [&, R = R, U = U](int k, int L, const Tensor2&) -> Tensor2 {
    Tensor2 A = Tensor2::Zero();  // R^T dF
    A.col(L) = R.row(k).transpose();
    // R^T dR = W skew with U W + W U = A - A^T: (tr U I - U) w = axial(A - A^T).
    const Eigen::Vector3d axial(A(2, 1) - A(1, 2), A(0, 2) - A(2, 0), A(1, 0) - A(0, 1));
    const Eigen::Vector3d w = spin_solver * axial;
    Tensor2 W;
    W << 0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0;
    const Tensor2 dU = A - W * U;
    const Tensor2 e = dU * U_n_inverse;
    const Tensor2 ds = unflat(C * flat(0.5 * (e + e.transpose())));
    return R * (W * s - s * W + ds) * R.transpose();
  });
}

MandelVector to_mandel(const Tensor2& T, const StrainComponents& components) {
  MandelVector v(components.size());
  for (std::size_t a = 0; a < components.size(); ++a) {
    const auto [i, j] = kMandel[components[a]];
    v[static_cast<int>(a)] = mandel_factor(components[a]) * 0.5 * (T(i, j) + T(j, i));
  }
  return v;
}

MandelMatrix to_mandel(const Tensor4& C, const StrainComponents& components) {
  const int n = static_cast<int>(components.size());
  MandelMatrix M(n, n);
  for (int a = 0; a < n; ++a) {
    for (int b = 0; b < n; ++b) {
      const auto [i, j] = kMandel[components[a]];
      const auto [k, l] = kMandel[components[b]];
      M(a, b) = mandel_factor(components[a]) * mandel_factor(components[b]) * C(pair(i, j), pair(k, l));
    }
  }
  return M;
}

Tensor4 from_mandel(const MandelMatrix& M, const StrainComponents& components) {
  Tensor4 C = Tensor4::Zero();
  const int n = static_cast<int>(components.size());
  for (int a = 0; a < n; ++a) {
    for (int b = 0; b < n; ++b) {
      const auto [i, j] = kMandel[components[a]];
      const auto [k, l] = kMandel[components[b]];
      const double value = M(a, b) / (mandel_factor(components[a]) * mandel_factor(components[b]));
      C(pair(i, j), pair(k, l)) = C(pair(j, i), pair(k, l)) = value;
      C(pair(i, j), pair(l, k)) = C(pair(j, i), pair(l, k)) = value;
    }
  }
  return C;
}

LearnedTangent::LearnedTangent(const Tensor4& elastic, const StrainComponents& components, const LearningLimits& limits)
    : components_(components), limits_(limits), C_(to_mandel(elastic, components)) {
  cholesky_ = C_.llt().matrixL();
  unknown_ = MandelMatrix::Identity(C_.rows(), C_.cols());
  begin_step(Tensor2::Identity(), Tensor2::Zero());
}

void LearnedTangent::begin_step(const Tensor2& F, const Tensor2& stress) {
  const auto [R, U] = polar_decomposition(F);
  U_n_ = U;
  strain_ = MandelVector::Zero(static_cast<int>(components_.size()));
  stress_ = unrotated(stress, R);
  first_ = true;
  unknown_ += kForgotten * (MandelMatrix::Identity(C_.rows(), C_.cols()) - unknown_);
}

MandelVector LearnedTangent::strain(const Tensor2& U) const {
  return to_mandel(Tensor2(U * U_n_.inverse() - Tensor2::Identity()), components_);
}

MandelVector LearnedTangent::unrotated(const Tensor2& stress, const Tensor2& R) const {
  return to_mandel(Tensor2(R.transpose() * stress * R), components_);
}

Misfit LearnedTangent::learn(const Tensor2& F, const Tensor2& stress) {
  const auto [R, U] = polar_decomposition(F);
  const MandelVector s = strain(U) - strain_;
  const MandelVector y = unrotated(stress, R) - stress_;
  if (s.norm() < limits_.noise) return {};
  strain_ += s;
  stress_ += y;
  const MandelVector expected = C_ * s, missed = y - expected;
  const Misfit misfit = first_ ? Misfit{} : Misfit{missed.squaredNorm(), expected.squaredNorm()};
  C_ += missed * gain(s).transpose();
  first_ = false;
  bound();
  return misfit;
}

Tensor2 LearnedTangent::predict(const Tensor2& F, const Tensor2& from, const Tensor2& stress) const {
  const auto [R, U] = polar_decomposition(F);
  const auto [R_from, U_from] = polar_decomposition(from);
  const Tensor2 e = (U - U_from) * U_n_.inverse();
  const Tensor2 change = unflat(from_mandel(C_, components_) * flat(0.5 * (e + e.transpose())));
  return R * (R_from.transpose() * stress * R_from + change) * R.transpose();
}

MandelVector LearnedTangent::gain(const MandelVector& strain_change) {
  const double weight = first_ ? limits_.first : 1;
  if (limits_.scatter == 0) return weight * strain_change / strain_change.squaredNorm();
  const MandelVector s = cholesky_.transpose() * strain_change;
  const double size = s.squaredNorm();
  if (first_) first_change_ = size;
  if (weight == 0) return MandelVector::Zero(s.size());
  const double scatter = first_ ? (1 / weight - 1) * size : limits_.scatter * limits_.scatter * size;
  const MandelVector Ps = unknown_ * s;
  const MandelVector g = Ps / (s.dot(Ps) + scatter + kLeastChange * kLeastChange * first_change_);
  unknown_ -= g * Ps.transpose();
  return cholesky_ * g;
}

void LearnedTangent::bound() {
  const auto L = cholesky_.triangularView<Eigen::Lower>();
  const MandelMatrix half = L.solve(C_);
  const MandelMatrix M = L.solve(half.transpose()).transpose();  // L^-1 C L^-T
  MandelMatrix skew = 0.5 * (M - M.transpose());
  const double size = skew.norm();
  if (size > limits_.skew) skew *= limits_.skew / size;
  const Eigen::SelfAdjointEigenSolver<MandelMatrix> eigen(MandelMatrix(0.5 * (M + M.transpose())));
  MandelVector values = eigen.eigenvalues();
  for (double& value : values) value = std::clamp(value, limits_.min, limits_.max);
  const MandelMatrix bounded = eigen.eigenvectors() * values.asDiagonal() * eigen.eigenvectors().transpose() + skew;
  C_ = cholesky_ * bounded * cholesky_.transpose();
}

StrainProbe LearnedTangent::start_probe(const Tensor2& F, const Tensor2& stress, double size) const {
  const auto [R, U] = polar_decomposition(F);
  const int n = static_cast<int>(components_.size());
  return {size, strain(U), unrotated(stress, R), MandelMatrix(n, n), MandelMatrix(n, n)};
}

Tensor2 LearnedTangent::probe(const StrainProbe& probe, const Tensor2& F, int component) const {
  const auto [R, U] = polar_decomposition(F);
  const auto [i, j] = kMandel[components_[component]];
  Tensor2 e = Tensor2::Zero();
  e(i, j) = e(j, i) = probe.size / mandel_factor(components_[component]);
  return R * (U + e * U_n_);
}

void LearnedTangent::record(StrainProbe& probe, const Tensor2& probed_F, const Tensor2& stress, int component) const {
  const auto [R, U] = polar_decomposition(probed_F);
  probe.strains.col(component) = strain(U) - probe.strain;
  probe.stresses.col(component) = unrotated(stress, R) - probe.stress;
}

void LearnedTangent::finish_probe(const StrainProbe& probe) {
  C_ = probe.stresses * MandelMatrix(probe.strains).inverse();
}

Tensor4 LearnedTangent::piola(const Tensor2& F, const Tensor2& stress) const {
  return piola_corotational(from_mandel(C_, components_), stress, F, U_n_);
}

double LearnedTangent::least_eigenvalue() const {
  const auto L = cholesky_.triangularView<Eigen::Lower>();
  const MandelMatrix half = L.solve(C_);
  const MandelMatrix M = L.solve(half.transpose());
  return Eigen::SelfAdjointEigenSolver<MandelMatrix>(MandelMatrix(0.5 * (M + M.transpose()))).eigenvalues().minCoeff();
}

void LearnedTangent::save(std::vector<double>& values) const {
  values.insert(values.end(), C_.data(), C_.data() + C_.size());
  values.insert(values.end(), cholesky_.data(), cholesky_.data() + cholesky_.size());
  values.insert(values.end(), unknown_.data(), unknown_.data() + unknown_.size());
}

void LearnedTangent::load(const std::vector<double>& values, std::size_t& position) {
  for (MandelMatrix* M : {&C_, &cholesky_, &unknown_}) {
    for (Eigen::Index i = 0; i < M->size(); ++i) M->data()[i] = values.at(position++);
  }
}

}  // namespace femxdem
