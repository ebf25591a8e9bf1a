#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "analytic_points.hpp"
#include "errors.hpp"

namespace femxdem {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// Plane-strain deformation gradient.
Tensor2 plane(double F11, double F12, double F21, double F22) {
  return (Tensor2() << F11, F12, 0, F21, F22, 0, 0, 0, 1).finished();
}

/// Follows F(s), s from 0 to 1 in equal steps; returns the last committed state.
template <class Path>
LawState follow(const AnalyticLaw& law, int steps, const Path& F) {
  LawState state = initial_state(law);
  for (int i = 1; i <= steps; ++i) {
    LawState trial;
    const Response response = update(law, state, F(double(i) / steps), Operator::none, trial);
    EXPECT_FALSE(response.failure.has_value());
    state = trial;
  }
  return state;
}

/// Biaxial test: F22 goes to `height` in equal steps while F11 keeps sigma_11 (Newton with the tangent).
LawState biaxial(const AnalyticLaw& law, int steps, double height, double sigma_11) {
  LawState state = initial_state(law);
  for (int i = 1; i <= steps; ++i) {
    double width = state.F(0, 0);
    LawState trial;
    for (int iteration = 0;; ++iteration) {
      const Tensor2 F = plane(width, 0, 0, 1 + i * (height - 1) / steps);
      const Response response = update(law, state, F, Operator::tangent, trial);
      const double off = response.stress(0, 0) - sigma_11;
      if (std::abs(off) < 1e-12 * response.stress.norm()) break;
      EXPECT_LT(iteration, 20);
      if (iteration == 20) return trial;
      width *= 1 - off / response.stiffness(0, 0);  // dF11 = h11 F11
    }
    state = trial;
  }
  return state;
}

/// d sigma / dh by central differences, F -> (I + eps h) F.
Tensor4 difference_tangent(const AnalyticLaw& law, const LawState& state, const Tensor2& F) {
  const double eps = 1e-6;
  Tensor4 tangent;
  for (int k = 0; k < 3; ++k)
    for (int l = 0; l < 3; ++l) {
      Tensor2 h = Tensor2::Zero();
      h(k, l) = eps;
      LawState trial;
      const Tensor2 up = update(law, state, F + h * F, Operator::none, trial).stress;
      const Tensor2 down = update(law, state, F - h * F, Operator::none, trial).stress;
      const Tensor2 slope = (up - down) / (2 * eps);
      tangent.col(pair(k, l)) = slope.reshaped<Eigen::RowMajor>();
    }
  return tangent;
}

void expect_exact_tangent(const AnalyticLaw& law, const LawState& state, const Tensor2& F) {
  LawState trial;
  const Response response = update(law, state, F, Operator::tangent, trial);
  ASSERT_FALSE(response.failure.has_value());
  const Tensor4 reference = difference_tangent(law, state, F);
  EXPECT_LT((response.stiffness - reference).norm(), 1e-7 * reference.norm());
}

const VonMisesLaw kVonMises{.young = 1000, .poisson = 0.25, .yield_stress = 6, .hardening = -40, .residual_stress = 2};
const DruckerPragerLaw kDruckerPrager{.young = 1000,
                                      .poisson = 0.25,
                                      .cohesion = 2,
                                      .friction_angle = 30 * kDegree,
                                      .dilatancy_angle = 10 * kDegree,
                                      .hardening = -20,
                                      .residual_stress = 0.5,
                                      .initial_pressure = 3};
const BilinearLaw kBar{.A1 = 100, .A2 = -10, .limit_strain = 0.01};

/// Errors of sigma_11 and sigma_12 at gamma = 4 against G (1 - cos gamma) and G sin gamma (Dienes, 1979), G = 1.
Eigen::Array2d shear_errors(int steps) {
  const double gamma = 4;
  const Tensor2 s = follow(JaumannLaw{.young = 2.5, .poisson = 0.25}, steps, [&](double t) {
                      return plane(1, gamma * t, 0, 1);
                    }).stress;
  return {s(0, 0) - (1 - std::cos(gamma)), s(0, 1) - std::sin(gamma)};
}

TEST(JaumannLaw, SimpleShearIsSecondOrder) {
  const Eigen::Array2d coarse = shear_errors(100);
  // g = gamma / 100: sigma_12 = (1 + g^2 / 16) sin(gamma - gamma g^2 / 48) to leading order
  EXPECT_LT(std::abs(coarse[1]), 1.2e-5);
  EXPECT_LT(std::abs(coarse[0]), 2.7e-4);
  const Eigen::Array2d order = (coarse / shear_errors(200)).log() / std::log(2.0);
  EXPECT_NEAR(order[0], 2, 0.01);
  EXPECT_NEAR(order[1], 2, 0.05);
}

TEST(JaumannLaw, BiaxialTestHasItsLogarithmicSolution) {
  const JaumannLaw law{.young = 2.6, .poisson = 0.3};  // G = 1, lambda = 1.5
  const LawState state = biaxial(law, 400, 0.7, 0);
  EXPECT_NEAR(state.F(0, 0), 1.16516265, 1e-7);
  EXPECT_NEAR(state.stress(1, 1), -1.01907127, 2e-7);
  const LawState confined = follow(law, 400, [](double t) { return plane(1, 0, 0, 1 - 0.3 * t); });
  EXPECT_NEAR(confined.stress(1, 1), 3.5 * std::log(0.7), 4e-7);
}

TEST(AnalyticLaws, RigidRotationTurnsTheStress) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, -2, 0.5).normalized();
  for (const AnalyticLaw& law :
       {AnalyticLaw(JaumannLaw{1000, 0.25, 3}), AnalyticLaw(kVonMises), AnalyticLaw(kDruckerPrager)}) {
    const LawState state = follow(law, 20, [](double t) { return plane(1 + 0.01 * t, 0.03 * t, 0, 1 - 0.02 * t); });
    for (const double angle : {1e-4, 0.5, 90 * kDegree, 120 * kDegree}) {
      const Tensor2 R = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
      LawState trial;
      const Response response = update(law, state, R * state.F, Operator::none, trial);
      EXPECT_LT((response.stress - rotate(state.stress, R)).norm(), 1e-12 * state.stress.norm());
      EXPECT_NEAR(trial.softening_strain, state.softening_strain, 1e-13);
    }
  }
}

/// Tangents from a state far along a plane path, for a general increment onwards and one backwards (unloading).
void expect_exact_tangents(const AnalyticLaw& law, const LawState& state) {
  const Tensor2 onwards = (Tensor2() << 1.31, 0.37, 0.02, 0.08, 0.68, -0.05, 0.03, 0.01, 1.04).finished();
  expect_exact_tangent(law, state, onwards);
  expect_exact_tangent(law, state, Tensor2(state.F + 1e-3 * (Tensor2::Identity() - state.F)));
}

LawState strained(const AnalyticLaw& law) {
  return follow(law, 20, [](double t) { return plane(1 + 0.2 * t, 0.3 * t, 0.1 * t, 1 - 0.25 * t); });
}

TEST(AnalyticLaws, ElasticTangentsAreExactAtFiniteStrain) {
  VonMisesLaw strong = kVonMises;
  strong.yield_stress = 1e4;
  for (const AnalyticLaw& law :
       {AnalyticLaw(ElasticLaw{1000, 0.25, 3}), AnalyticLaw(JaumannLaw{1000, 0.25, 3}), AnalyticLaw(strong)}) {
    SCOPED_TRACE(law.index());
    expect_exact_tangents(law, strained(law));
    EXPECT_LT(strained(law).softening_strain, 1e-15);
  }
}

TEST(AnalyticLaws, PlasticTangentsAreExactAtFiniteStrain) {
  VonMisesLaw softening = kVonMises;
  softening.hardening = -2;
  VonMisesLaw hardening = kVonMises;
  hardening.hardening = 100;
  DruckerPragerLaw slow = kDruckerPrager;
  slow.hardening = -0.5;
  for (const AnalyticLaw& law : {AnalyticLaw(softening), AnalyticLaw(hardening), AnalyticLaw(slow),
                                 AnalyticLaw(kVonMises), AnalyticLaw(kDruckerPrager)}) {
    SCOPED_TRACE(law.index());
    const LawState state = strained(law);
    EXPECT_GT(state.softening_strain, 0.3);  // the floor of the two named k..., not yet of the others
    expect_exact_tangents(law, state);
  }
}

TEST(BilinearLaw, TangentIsExactOnEveryBranch) {
  BilinearLaw rounded = kBar;
  rounded.smoothing = 0.004;
  BilinearLaw floored = kBar;
  floored.residual_stress = 0.3;
  const LawState loaded = follow(kBar, 1, [](double) { return plane(1.02, 0, 0, 1); });
  for (const double e : {0.005, 0.009, 0.012, 0.03, 0.09, 0.2}) {
    const Tensor2 F = plane(1 + e, 0.1, 0.2, 0.9);
    for (const BilinearLaw& law : {kBar, rounded, floored}) {
      expect_exact_tangent(law, initial_state(law), F);
      expect_exact_tangent(law, loaded, F);
    }
  }
}

TEST(BilinearLaw, LoadsSoftensAndUnloads) {
  const auto force = [](double e, double largest) {
    LawState state;
    state.softening_strain = largest;
    LawState trial;
    return update(kBar, state, plane(1 + e, 0, 0, 1), Operator::none, trial).stress(0, 0);
  };
  EXPECT_NEAR(force(0.005, 0), 0.5, 1e-13);
  EXPECT_NEAR(force(-0.05, 0), -5, 1e-13);
  EXPECT_NEAR(force(0.02, 0), 0.9, 1e-13);
  EXPECT_NEAR(force(0.015, 0.02), 0.4, 1e-13);  // slope A1 down from (0.02, 0.9)
  EXPECT_NEAR(force(0.03, 0.02), 0.8, 1e-13);
  EXPECT_NEAR(force(0.5, 0), 0, 1e-13);  // the floor, from e = 0.11 on
}

TEST(BilinearLaw, OtherComponentsAreElasticAndUncoupled) {
  LawState trial;
  const Tensor2 s = update(kBar, {}, plane(1, 0.02, 0.01, 1.03), Operator::none, trial).stress;
  EXPECT_NEAR(s(0, 0), 0, 1e-14);
  EXPECT_NEAR(s(0, 1), 1.5, 1e-13);
  EXPECT_NEAR(s(1, 1), 3, 1e-13);
  EXPECT_NEAR(s(2, 2), 0, 1e-14);
}

TEST(VonMisesLaw, PlaneStrainStrengthIsTwiceTheShearYieldStress) {
  const VonMisesLaw law{.young = 1000, .poisson = 0.25, .yield_stress = 6};
  const LawState state = biaxial(law, 100, 0.8, 0);
  EXPECT_NEAR(state.stress(1, 1), -2 * 6 / std::sqrt(3.0), 1e-6);
}

/// Shear strength along diag(exp(a), exp(-a)): tau = G (gamma - gamma_p) = k0 + k' gamma_p, gamma = 2 a.
TEST(VonMisesLaw, SoftensLinearlyToItsFloorAndUnloadsElastically) {
  const double G = 400;
  const double k0 = 6 / std::sqrt(3.0);
  const double slope = -40.0 / 3;
  const auto pure_shear = [](double a) {
    return [a](double t) { return plane(std::exp(a * t), 0, 0, std::exp(-a * t)); };
  };
  for (const double a : {0.004, 0.02, 0.06}) {
    const LawState state = follow(kVonMises, 400, pure_shear(a));
    const double softened = (k0 + slope * 2 * a) / (1 + slope / G);
    const double expected = a < k0 / (2 * G) ? 2 * G * a : softened;
    EXPECT_NEAR(state.stress(0, 0), expected, 1e-6);
    EXPECT_NEAR(state.stress(1, 1), -expected, 1e-6);
    EXPECT_NEAR(state.softening_strain, 2 * a - expected / G, 1e-8);
  }
  const LawState state = follow(kVonMises, 400, pure_shear(0.3));
  EXPECT_NEAR(state.stress(0, 0), 2 / std::sqrt(3.0), 1e-9);
  LawState back;
  const Response response = update(kVonMises, state, plane(0.999, 0, 0, 1 / 0.999) * state.F, Operator::tangent, back);
  EXPECT_NEAR(response.stress(0, 0), state.stress(0, 0) + 2 * G * std::log(0.999), 1e-6);
  EXPECT_EQ(back.softening_strain, state.softening_strain);
}

/// Work = stored + dissipated energy, dissipation = int k(gamma_p) dgamma_p, on a path that turns (small strain).
TEST(VonMisesLaw, WorkIsStoredOrDissipated) {
  const int steps = 4000;
  LawState state = initial_state(kVonMises);
  double work = 0;
  for (int i = 1; i <= steps; ++i) {
    const double t = double(i) / steps;
    LawState trial;
    const double shear = 1e-2 * std::sin(4 * t);
    const Tensor2 F = plane(1 + 1e-2 * t, shear, shear, 1 - 1e-2 * t);
    const Tensor2 stress = update(kVonMises, state, F, Operator::none, trial).stress;
    work += 0.5 * (stress + state.stress).cwiseProduct((F - state.F) * (0.5 * (F + state.F)).inverse()).sum();
    state = trial;
  }
  const double G = 400, bulk = 2000.0 / 3;
  const double p = state.stress.trace() / 3;
  const Tensor2 s = state.stress - p * Tensor2::Identity();
  const double stored = s.squaredNorm() / (4 * G) + p * p / (2 * bulk);
  const double gamma = state.softening_strain;
  const double dissipated = 6 / std::sqrt(3.0) * gamma - 40.0 / 3 * gamma * gamma / 2;
  EXPECT_GT(dissipated, stored);
  EXPECT_NEAR(work, stored + dissipated, 1e-3 * work);
}

/// Associated flow along the plane-strain match: the limit load is Mohr-Coulomb's.
TEST(DruckerPragerLaw, PlaneStrainStrengthIsMohrCoulombs) {
  DruckerPragerLaw law = kDruckerPrager;
  law.hardening = 0;
  law.dilatancy_angle = law.friction_angle;
  const LawState state = biaxial(law, 200, 0.9, -3);
  const double N = (1 + std::sin(law.friction_angle)) / (1 - std::sin(law.friction_angle));
  EXPECT_NEAR(state.stress(1, 1), -(3 * N + 2 * law.cohesion * std::sqrt(N)), 1e-5);
}

/// Volume strain at the limit state follows the dilatancy angle: (de1 + de3) = -sin(psi) (de1 - de3) in plane strain.
TEST(DruckerPragerLaw, DilatesByItsOwnAngle) {
  DruckerPragerLaw law = kDruckerPrager;
  law.hardening = 0;
  const LawState early = biaxial(law, 200, 0.9, -3);
  const LawState late = biaxial(law, 220, 0.89, -3);
  const double e1 = std::log(late.F(0, 0) / early.F(0, 0));
  const double e2 = std::log(late.F(1, 1) / early.F(1, 1));
  EXPECT_NEAR((e1 + e2) / (e1 - e2), std::sin(law.dilatancy_angle), 1e-4);
}

TEST(DruckerPragerLaw, PullsApartAtTheApex) {
  const double tension = 2 / std::tan(30 * kDegree);  // c / tan(phi)
  LawState trial;
  const Tensor2 s = update(kDruckerPrager, initial_state(kDruckerPrager), Tensor2(1.1 * Tensor2::Identity()),
                           Operator::tangent, trial)
                        .stress;
  EXPECT_LT((s - tension * Tensor2::Identity()).norm(), 1e-12);
  Tensor2 F = 1.1 * Tensor2::Identity();
  F(0, 1) = 0.01;
  const Response sheared = update(kDruckerPrager, initial_state(kDruckerPrager), F, Operator::none, trial);
  EXPECT_GT(trial.softening_strain, 0.005);
  EXPECT_NEAR(sheared.stress(0, 1), 0, 1e-12);
  expect_exact_tangent(kDruckerPrager, initial_state(kDruckerPrager), F);
}

}  // namespace
}  // namespace femxdem
