#pragma once

#include <string>
#include <variant>

#include "material_parameters.hpp"
#include "material_points.hpp"

/// Constitutive laws in closed form, one material point at a time. Stresses are Cauchy [Pa], tension positive.
namespace femxdem {

/// Isotropic linear elasticity of the small strain: sigma = -p0 I + C : sym(F - I).
struct ElasticLaw {
  double young = 0;             ///< [Pa]
  double poisson = 0;           ///< [-]
  double initial_pressure = 0;  ///< p0 [Pa]: sigma = -p0 I at F = I
};

/// Hypoelasticity with the Jaumann rate; update of Hughes and Winget (1980) with half rotations, second order in the
/// step.
struct JaumannLaw {
  double young = 0;             ///< [Pa]
  double poisson = 0;           ///< [-]
  double initial_pressure = 0;  ///< [Pa]
};

/// Von Mises plasticity, q <= max(yield_stress + hardening eps_p, residual_stress), on the Jaumann update;
/// q = sqrt(3 J2), eps_p the equivalent plastic strain.
struct VonMisesLaw {
  double young = 0;             ///< [Pa]
  double poisson = 0;           ///< [-]
  double yield_stress = 0;      ///< in uniaxial tension [Pa]
  double hardening = 0;         ///< d(yield stress) / d(equivalent plastic strain) [Pa], negative: softening
  double residual_stress = 0;   ///< floor of the yield stress [Pa]
  double initial_pressure = 0;  ///< [Pa]
};

/// Drucker-Prager plasticity with cohesion softening and its own dilatancy, on the Jaumann update. The cone
/// sqrt(J2) + alpha I1 <= k has Mohr-Coulomb's limit load in plane strain for psi = phi (Drucker and Prager, 1952):
/// alpha = tan(phi) / sqrt(9 + 12 tan^2 phi), k = 3 c / sqrt(9 + 12 tan^2 phi); the flow has psi in the place of phi.
/// c = max(cohesion + hardening gamma_p, residual_stress), gamma_p = int sqrt(2 de_p : de_p) the plastic shear strain.
struct DruckerPragerLaw {
  double young = 0;             ///< [Pa]
  double poisson = 0;           ///< [-]
  double cohesion = 0;          ///< c [Pa]
  double friction_angle = 0;    ///< phi [rad]
  double dilatancy_angle = 0;   ///< psi [rad]
  double hardening = 0;         ///< dc / d(gamma_p) [Pa], negative: softening
  double residual_stress = 0;   ///< floor of the cohesion [Pa]
  double initial_pressure = 0;  ///< [Pa]
};

/// Softening bar of Chambon, Caillerie and El Hassan (1998) without Poisson's effect: sigma_11 = N(F11 - 1) with
/// N(e) = A1 e up to e_l, then slope A2 < 0 down to residual_stress, unloading with A1; the other components
/// sigma_ij = A1 sym(F - I)_ij. `smoothing` rounds the kink by a parabola over e_l +- smoothing.
struct BilinearLaw {
  double A1 = 0;               ///< [Pa]
  double A2 = 0;               ///< [Pa]
  double limit_strain = 0;     ///< e_l, strain at the peak [-]
  double residual_stress = 0;  ///< [Pa]
  double smoothing = 0;        ///< half width of the rounded kink [-]
};

/// The elastic law, failing once a component of F - I exceeds the limit: for tests of how failures are answered.
struct FailingLaw {
  double young = 0;           ///< [Pa]
  double poisson = 0;         ///< [-]
  double failing_strain = 0;  ///< [-]
};

using AnalyticLaw = std::variant<ElasticLaw, JaumannLaw, VonMisesLaw, DruckerPragerLaw, BilinearLaw, FailingLaw>;

/// History of a point that follows a law in closed form.
struct LawState {
  Tensor2 F = Tensor2::Identity();   ///< deformation gradient
  Tensor2 stress = Tensor2::Zero();  ///< Cauchy [Pa]
  double softening_strain = 0;       ///< von Mises, Drucker-Prager: gamma_p; bilinear: largest F11 - 1; else 0 [-]
};

/// The law in closed form that a [material] table describes.
AnalyticLaw make_law(const MaterialParameters& m);

/// Throws UserError when a parameter of the law lies outside its bounds; the sentence names it.
void check(const AnalyticLaw& law);

/// The state at F = I.
LawState initial_state(const AnalyticLaw& law);

/// Response of a point in the committed `state` to the trial F, and the trial state (unchanged on failure).
/// Operator::tangent is d sigma / dh exactly, with h = dF F^-1 at the trial and the spin of the stress included.
/// The point's index in a failure is left 0.
Response update(const AnalyticLaw& law, const LawState& state, const Tensor2& F, Operator wanted, LawState& trial);

}  // namespace femxdem
