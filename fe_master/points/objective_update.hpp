#pragma once

#include <limits>

#include "tensor.hpp"

namespace femxdem {

/// Lame's moduli [Pa].
struct Lame {
  double lambda;
  double G;
};

/// Yield cone sqrt(J2) + alpha I1 <= k(gamma_p) with flow along sqrt(J2) + beta I1 and
/// k = max(k0 + slope gamma_p, residual); without a limit by default. [Pa] but alpha, beta [-].
struct Cone {
  double alpha = 0;
  double beta = 0;
  double k0 = std::numeric_limits<double>::infinity();
  double slope = 0;
  double residual = 0;

  /// G + 9 K alpha beta: fall of sqrt(J2) + alpha I1 per plastic shear strain at fixed total strain [Pa].
  double elastic_fall(const Lame& moduli) const;
};

/// Isotropic elastoplastic increment of the Cauchy stress with the Jaumann rate: Hughes and Winget (1980), with the
/// strain increment at mid-step between two half rotations (second order in the step; the classic form is first order):
///   G = 2 (F_rel - I) (F_rel + I)^-1,  sigma = Qh s Qh^T,  s = return(Qh sigma_n Qh^T + C : sym G),
/// with Qh^2 the Cayley rotation of skew G. A rigid rotation is exact for any angle below 180 degrees; a rotation by
/// theta together with a strain in ONE increment changes the strain by some 0.2 theta^2 of itself (order of the step).
class ObjectiveUpdate {
 public:
  /// From the stress [Pa] and the plastic shear strain of the committed state along the relative gradient F F_n^-1.
  ObjectiveUpdate(const Lame& moduli, const Cone& cone, const Tensor2& stress, double plastic_shear,
                  const Tensor2& F_rel);
  /// Stress [Pa] and plastic shear strain at the end of the increment.
  void advance(Tensor2& stress, double& plastic_shear) const;
  /// d sigma / dh at the end of the increment, h = dF F^-1 [Pa]: algorithmic, exact (forward differentiation).
  Tensor4 tangent() const;

 private:
  Lame moduli_;
  Cone cone_;
  Tensor2 stress_;
  double plastic_shear_;
  Tensor2 F_rel_;
  Tensor2 B_;  // (F_rel + I)^-1
};

}  // namespace femxdem
