#include "analytic_laws.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "errors.hpp"
#include "objective_update.hpp"

namespace femxdem {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

Lame lame(double young, double poisson) {
  return {young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))};
}

/// 1 / sqrt(9 + 12 tan^2): Drucker-Prager's cone along Mohr-Coulomb's surface in plane strain.
double plane_strain_match(double angle) { return 1 / std::sqrt(9 + 12 * std::pow(std::tan(angle), 2)); }

Cone cone(const JaumannLaw&) { return {}; }

/// sqrt(3 J2) <= sigma_y as sqrt(J2) <= k; eps_p = gamma_p / sqrt(3).
Cone cone(const VonMisesLaw& law) {
  return {0, 0, law.yield_stress / std::sqrt(3.0), law.hardening / 3, law.residual_stress / std::sqrt(3.0)};
}

Cone cone(const DruckerPragerLaw& law) {
  const double match = plane_strain_match(law.friction_angle);
  return {match * std::tan(law.friction_angle), plane_strain_match(law.dilatancy_angle) * std::tan(law.dilatancy_angle),
          3 * match * law.cohesion, 3 * match * law.hardening, 3 * match * law.residual_stress};
}

Response failed(std::string sentence, std::string advice) {
  Response response;
  response.failure = Failure{0, std::move(sentence), std::move(advice)};
  return response;
}

/// d sigma / dh of a law sigma(sym(F - I)) with d sigma = C : de, C with minor symmetries: dF = h F.
Tensor4 small_strain_tangent(const Tensor4& C, const Tensor2& F) {
  Tensor4 tangent;
  for (int k = 0; k < 3; ++k) tangent.middleCols<3>(pair(k, 0)) = C.middleCols<3>(pair(k, 0)) * F.transpose();
  return tangent;
}

Tensor2 sym(const Tensor2& T) { return 0.5 * (T + T.transpose()); }

Response respond(const ElasticLaw& law, const LawState&, const Tensor2& F, Operator wanted, LawState& trial) {
  const auto [lambda, G] = lame(law.young, law.poisson);
  const Tensor2 e = sym(F - Tensor2::Identity());
  Response response;
  response.stress = (lambda * e.trace() - law.initial_pressure) * Tensor2::Identity() + 2 * G * e;
  if (wanted == Operator::elastic) response.stiffness = isotropic_stiffness(lambda, G);
  if (wanted == Operator::tangent) response.stiffness = small_strain_tangent(isotropic_stiffness(lambda, G), F);
  trial = {F, response.stress, 0};
  return response;
}

Response respond(const FailingLaw& law, const LawState& state, const Tensor2& F, Operator wanted, LawState& trial) {
  const double strain = (F - Tensor2::Identity()).cwiseAbs().maxCoeff();
  if (strain > law.failing_strain)
    return failed(fmt::format("strain {:.3e} beyond the limit {:.3e} of the failing law", strain, law.failing_strain),
                  "take a smaller step");
  return respond(ElasticLaw{law.young, law.poisson}, state, F, wanted, trial);
}

/// Irreversible strain of the bar, and its slope, once the largest strain has been `largest`:
/// e_p = (1 - A2 / A1) <e - limit_strain>, the ramp rounded by (x + s)^2 / (4 s) for |x| < s; floor: A1 (e - e_p) >=
/// residual.
struct BarHistory {
  double plastic_strain;
  double slope;  ///< d e_p / d(largest strain)
};

BarHistory bar_history(const BilinearLaw& law, double largest) {
  const double x = largest - law.limit_strain;
  const double s = law.smoothing;
  if (x <= -s) return {0, 0};
  const double ratio = 1 - law.A2 / law.A1;
  const double ramp = x < s ? (x + s) * (x + s) / (4 * s) : x;
  const double at_floor = largest - law.residual_stress / law.A1;
  if (ratio * ramp > at_floor) return {at_floor, 1};
  return {ratio * ramp, ratio * (x < s ? (x + s) / (2 * s) : 1)};
}

Response respond(const BilinearLaw& law, const LawState& state, const Tensor2& F, Operator wanted, LawState& trial) {
  const Tensor2 e = sym(F - Tensor2::Identity());
  const bool loading = e(0, 0) > state.softening_strain;
  const double largest = std::max(e(0, 0), state.softening_strain);
  const BarHistory history = bar_history(law, largest);
  Response response;
  response.stress = law.A1 * e;
  response.stress(0, 0) -= law.A1 * history.plastic_strain;
  if (wanted != Operator::none) {
    Tensor4 C = isotropic_stiffness(0, law.A1 / 2);
    if (wanted == Operator::tangent && loading) C(0, 0) -= law.A1 * history.slope;
    response.stiffness = wanted == Operator::tangent ? small_strain_tangent(C, F) : C;
  }
  trial = {F, response.stress, largest};
  return response;
}

template <class Law>
Response respond(const Law& law, const LawState& state, const Tensor2& F, Operator wanted, LawState& trial) {
  const Lame moduli = lame(law.young, law.poisson);
  const Tensor2 F_rel = F * state.F.inverse();
  if (!((F_rel + Tensor2::Identity()).determinant() > 1e-3))
    return failed("the increment turns the point by nearly 180 degrees", "take a smaller step");
  Response response;
  const ObjectiveUpdate update(moduli, cone(law), state.stress, state.softening_strain, F_rel);
  trial.F = F;
  update.advance(trial.stress, trial.softening_strain);
  response.stress = trial.stress;
  if (wanted == Operator::elastic) response.stiffness = isotropic_stiffness(moduli.lambda, moduli.G);
  if (wanted == Operator::tangent) response.stiffness = update.tangent();
  return response;
}

void require(bool condition, const std::string& sentence) {
  if (!condition) throw UserError("material: " + sentence);
}

template <class Law>
void check_elastic(const Law& law) {
  require(law.young > 0, fmt::format("young = {} must be positive", law.young));
  require(law.poisson > -1 && law.poisson < 0.5, fmt::format("poisson = {} must lie between -1 and 0.5", law.poisson));
}

/// The return to the cone is unique only while the softening is slower than the elastic unloading.
template <class Law>
void check_softening(const Law& law) {
  check_elastic(law);
  require(law.residual_stress >= 0, fmt::format("residual_stress = {} must not be negative", law.residual_stress));
  const double fall = cone(law).elastic_fall(lame(law.young, law.poisson));
  require(fall > 0, "dilatancy_angle is so negative that the return to the cone is not unique; raise it");
  const double ratio = -cone(law).slope / fall;
  require(ratio < 1, fmt::format("hardening = {} softens faster than the point unloads; keep it above {:.4g}",
                                 law.hardening, law.hardening / ratio));
}

void check_law(const ElasticLaw& law) { check_elastic(law); }

void check_law(const JaumannLaw& law) { check_elastic(law); }

void check_law(const FailingLaw& law) { check_elastic(law); }

void check_law(const VonMisesLaw& law) {
  check_softening(law);
  require(law.yield_stress > 0, fmt::format("yield_stress = {} must be positive", law.yield_stress));
}

void check_law(const DruckerPragerLaw& law) {
  check_softening(law);
  require(law.cohesion >= 0, fmt::format("cohesion = {} must not be negative", law.cohesion));
  require(law.friction_angle >= 0 && law.friction_angle < 90 * kDegree,
          fmt::format("friction_angle = {:g} degrees must lie between 0 and 90", law.friction_angle / kDegree));
  require(std::abs(law.dilatancy_angle) <= law.friction_angle,
          fmt::format("dilatancy_angle = {:g} degrees must not exceed friction_angle = {:g} degrees",
                      law.dilatancy_angle / kDegree, law.friction_angle / kDegree));
}

void check_law(const BilinearLaw& law) {
  require(law.A1 > 0, fmt::format("A1 = {} must be positive", law.A1));
  require(law.A2 < law.A1, fmt::format("A2 = {} must be below A1 = {}", law.A2, law.A1));
  require(law.limit_strain > 0, fmt::format("limit_strain = {} must be positive", law.limit_strain));
  require(law.smoothing >= 0 && law.smoothing < law.limit_strain,
          fmt::format("smoothing = {} must lie between 0 and limit_strain = {}", law.smoothing, law.limit_strain));
  require(law.residual_stress >= 0 && law.residual_stress < law.A1 * law.limit_strain,
          fmt::format("residual_stress = {} must lie between 0 and the peak A1 limit_strain = {}", law.residual_stress,
                      law.A1 * law.limit_strain));
}

}  // namespace

void check(const AnalyticLaw& law) {
  std::visit([](const auto& l) { check_law(l); }, law);
}

LawState initial_state(const AnalyticLaw& law) {
  LawState state;
  std::visit(
      [&](const auto& l) {
        if constexpr (requires { l.initial_pressure; }) state.stress = -l.initial_pressure * Tensor2::Identity();
      },
      law);
  return state;
}

Response update(const AnalyticLaw& law, const LawState& state, const Tensor2& F, Operator wanted, LawState& trial) {
  trial = state;
  if (!F.allFinite()) return failed("the deformation gradient is not finite", "take a smaller step");
  if (!(F.determinant() > 0))
    return failed(fmt::format("det F = {:.3e} is not positive", F.determinant()), "take a smaller step");
  Response response = std::visit([&](const auto& l) { return respond(l, state, F, wanted, trial); }, law);
  if (response.failure || response.stress.allFinite()) return response;
  trial = state;
  return failed("the stress is not finite", "take a smaller step");
}

AnalyticLaw make_law(const MaterialParameters& m) {
  constexpr double degree = std::numbers::pi / 180;
  switch (m.type) {
    case MaterialType::jaumann:
      return JaumannLaw{m.young, m.poisson, m.initial_pressure};
    case MaterialType::von_mises:
      return VonMisesLaw{m.young, m.poisson, m.yield_stress, m.hardening, m.residual_stress, m.initial_pressure};
    case MaterialType::drucker_prager:
      return DruckerPragerLaw{
          m.young,     m.poisson,         m.cohesion,        m.friction_angle * degree, m.dilatancy_angle * degree,
          m.hardening, m.residual_stress, m.initial_pressure};
    case MaterialType::bilinear:
      return BilinearLaw{m.A1, m.A2, m.limit_strain, m.residual_stress, 0};
    default:
      return ElasticLaw{m.young, m.poisson, m.initial_pressure};
  }
}

}  // namespace femxdem
