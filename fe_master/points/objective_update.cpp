#include "objective_update.hpp"

#include <cmath>
#include <unsupported/Eigen/AutoDiff>

namespace femxdem {
namespace {

/// A number with its derivatives with respect to the nine h_kl.
using Differentiable = Eigen::AutoDiffScalar<Eigen::Matrix<double, 9, 1>>;
template <class Scalar>
using Matrix3 = Eigen::Matrix<Scalar, 3, 3>;

double value(double x) { return x; }
double value(const Differentiable& x) { return x.value(); }

/// Half of the Cayley rotation of the spin w: tan(theta/2) = |w|/2 there, tan(theta/4) = |w|/2 / (1 + sqrt(1 +
/// |w|^2/4)) here, and Q = I + 2 (A + A^2) / (1 + |A|^2) for the skew A of axial length tan of half the angle.
template <class Scalar>
Matrix3<Scalar> half_rotation(const Matrix3<Scalar>& w) {
  using std::sqrt;
  const Scalar squared = w(2, 1) * w(2, 1) + w(0, 2) * w(0, 2) + w(1, 0) * w(1, 0);
  const Scalar scale = 0.5 / (1 + sqrt(1 + 0.25 * squared));
  const Scalar share = 2 / (1 + squared * scale * scale);
  const Matrix3<Scalar> A = w * scale;
  Matrix3<Scalar> Q = (A + A * A) * share;
  for (int i = 0; i < 3; ++i) Q(i, i) += 1;
  return Q;
}

/// Closest-point return of the trial stress to the cone, in closed form because k is piecewise linear; beyond the apex
/// the stress is k / (3 alpha) I and the plastic shear strain sqrt(J2) / G.
template <class Scalar>
void return_to_cone(const Lame& moduli, const Cone& cone, Matrix3<Scalar>& stress, Scalar& plastic_shear) {
  using std::sqrt;
  const Scalar I1 = stress.trace();
  Matrix3<Scalar> s = stress;
  for (int i = 0; i < 3; ++i) s(i, i) -= I1 / 3;
  const Scalar J2 = 0.5 * s.squaredNorm();
  const Scalar t = value(J2) > 0 ? Scalar(sqrt(J2)) : Scalar(0);
  const auto k = [&](const Scalar& shear) {
    const Scalar sloped = cone.k0 + cone.slope * shear;
    return value(sloped) > cone.residual ? sloped : Scalar(cone.residual);
  };
  const Scalar overstress = t + cone.alpha * I1 - k(plastic_shear);
  if (!(value(overstress) > 0)) return;

  const double fall = cone.elastic_fall(moduli);
  Scalar increment = overstress / (fall + cone.slope);
  if (cone.slope < 0 && value(plastic_shear + increment) * cone.slope + cone.k0 < cone.residual)
    increment = (t + cone.alpha * I1 - cone.residual) / fall;
  const double bulk = moduli.lambda + 2 * moduli.G / 3;
  Scalar shrink = 0;
  Scalar I1_end = I1 - 9 * bulk * cone.beta * increment;
  if (cone.alpha > 0 && value(t) <= moduli.G * value(increment)) {
    increment = t / moduli.G;
    I1_end = k(plastic_shear + increment) / cone.alpha;
  } else {
    shrink = 1 - moduli.G * increment / t;
  }
  plastic_shear += increment;
  stress = s * shrink;
  for (int i = 0; i < 3; ++i) stress(i, i) += I1_end / 3;
}

/// End of the increment for the mid-step gradient G; `stress` and `plastic_shear` enter as the committed ones.
template <class Scalar>
void advance_along(const Lame& moduli, const Cone& cone, const Matrix3<Scalar>& G, Matrix3<Scalar>& stress,
                   Scalar& plastic_shear) {
  const Matrix3<Scalar> strain = (G + G.transpose()) * 0.5;
  const Matrix3<Scalar> spin = (G - G.transpose()) * 0.5;
  const Matrix3<Scalar> Qh = half_rotation<Scalar>(spin);
  const Scalar volumetric = moduli.lambda * strain.trace();
  Matrix3<Scalar> mid = Qh * stress * Qh.transpose();
  mid += strain * (2 * moduli.G);
  for (int i = 0; i < 3; ++i) mid(i, i) += volumetric;
  return_to_cone(moduli, cone, mid, plastic_shear);
  const Matrix3<Scalar> end = Qh * mid * Qh.transpose();
  stress = (end + end.transpose()) * 0.5;
}

}  // namespace

double Cone::elastic_fall(const Lame& moduli) const {
  return moduli.G + (9 * moduli.lambda + 6 * moduli.G) * alpha * beta;
}

ObjectiveUpdate::ObjectiveUpdate(const Lame& moduli, const Cone& cone, const Tensor2& stress, double plastic_shear,
                                 const Tensor2& F_rel)
    : moduli_(moduli),
      cone_(cone),
      stress_(stress),
      plastic_shear_(plastic_shear),
      F_rel_(F_rel),
      B_((F_rel + Tensor2::Identity()).inverse()) {}

void ObjectiveUpdate::advance(Tensor2& stress, double& plastic_shear) const {
  stress = stress_;
  plastic_shear = plastic_shear_;
  const Tensor2 G = 2 * (F_rel_ - Tensor2::Identity()) * B_;
  advance_along<double>(moduli_, cone_, G, stress, plastic_shear);
}

Tensor4 ObjectiveUpdate::tangent() const {
  const Tensor2 G = 2 * (F_rel_ - Tensor2::Identity()) * B_;
  const Tensor2 F_rel_B = F_rel_ * B_;
  Matrix3<Differentiable> G_h, stress;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      stress(i, j) = stress_(i, j);
      G_h(i, j).value() = G(i, j);
      for (int k = 0; k < 3; ++k)  // G = 2 I - 4 B and dF_rel = h F_rel: dG = 4 B h F_rel B
        for (int l = 0; l < 3; ++l) G_h(i, j).derivatives()[pair(k, l)] = 4 * B_(i, k) * F_rel_B(l, j);
    }
  Differentiable plastic_shear = plastic_shear_;
  advance_along<Differentiable>(moduli_, cone_, G_h, stress, plastic_shear);
  Tensor4 tangent;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) tangent.row(pair(i, j)) = stress(i, j).derivatives().transpose();
  return tangent;
}

}  // namespace femxdem
