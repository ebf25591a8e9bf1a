#include "localisation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "analytic_laws.hpp"
#include "analytic_points.hpp"
#include "point_operators.hpp"

namespace femxdem {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
using Vector9 = Eigen::Matrix<double, 9, 1>;

/// Tangent of plane-strain Mohr-Coulomb with f = (s1 - s3)/2 + (s1 + s3)/2 sin(phi), flow with psi, hardening modulus
/// h, on isotropic elasticity with E = 1; s1 (the largest stress) along x1.
Tensor4 mohr_coulomb_tangent(double poisson, double phi, double psi, double h) {
  const double G = 1 / (2 * (1 + poisson));
  const Tensor4 C = isotropic_stiffness(2 * G * poisson / (1 - 2 * poisson), G);
  const auto gradient = [](double angle) {
    Vector9 g = Vector9::Zero();
    g[pair(0, 0)] = 0.5 * (1 + std::sin(angle));
    g[pair(1, 1)] = 0.5 * (-1 + std::sin(angle));
    return g;
  };
  const Vector9 CP = C * gradient(psi);
  const Vector9 CQ = C * gradient(phi);
  return C - CP * CQ.transpose() / (h + gradient(phi).dot(CP));
}

double critical_hardening(double poisson, double phi, double psi) {
  return std::pow(std::sin(phi) - std::sin(psi), 2) / (16 * (1 - poisson * poisson));
}

TEST(Localisation, MohrCoulombLocalisesAtItsCriticalHardening) {
  const double phi = 30 * kDegree;
  const double psi = 10 * kDegree;
  for (const double poisson : {0.0, 0.25}) {
    const double h = critical_hardening(poisson, phi, psi);
    double angle = 0;
    const double at = min_acoustic_determinant(mohr_coulomb_tangent(poisson, phi, psi, h), &angle);
    EXPECT_GT(min_acoustic_determinant(mohr_coulomb_tangent(poisson, phi, psi, 1.02 * h)), 1e-5);
    EXPECT_LT(min_acoustic_determinant(mohr_coulomb_tangent(poisson, phi, psi, 0.98 * h)), -1e-5);
    EXPECT_NEAR(at, 0, 1e-5);
    const double rice = 0.5 * std::acos(-0.5 * (std::sin(phi) + std::sin(psi)));
    EXPECT_NEAR(rice / kDegree, 54.84, 0.005);
    const double band = std::min(angle, std::numbers::pi - angle);
    EXPECT_NEAR(band / kDegree, rice / kDegree, 0.26);
  }
}

TEST(Localisation, ElasticDeterminantIsThatOfTheWaves) {
  EXPECT_NEAR(min_acoustic_determinant(isotropic_stiffness(3, 2)), 7 * 2, 1e-12);  // (lambda + 2 G) G
}

TEST(Localisation, VonMisesSofteningLocalisesAlongItsPlanesOfShear) {
  VonMisesLaw law{.young = 1000, .poisson = 0.25, .yield_stress = 6, .hardening = -40, .residual_stress = 2};
  const auto determinant = [](const AnalyticLaw& material, double a, double* angle) {
    LawState trial;
    const Tensor2 F = Eigen::Vector3d(1 + a, 1 - a, 1).asDiagonal();
    return min_acoustic_determinant(update(material, initial_state(material), F, Operator::tangent, trial).stiffness,
                                    angle);
  };
  double angle = 0;
  EXPECT_NEAR(determinant(law, 1e-4, &angle) / (1200 * 400), 1, 1e-3);  // elastic: (lambda + 2 G) G
  EXPECT_LT(determinant(law, 1e-2, &angle), 0);
  EXPECT_NEAR(angle, 45 * kDegree, 0.6 * kDegree);
  law.hardening = 400;
  EXPECT_GT(determinant(law, 1e-2, &angle), 0);
}

TEST(Localisation, OperatorsTellItOfTheirTangents) {
  AnalyticPoints points(
      {VonMisesLaw{.young = 1000, .poisson = 0.25, .yield_stress = 6, .hardening = -40, .residual_stress = 2}});
  const std::vector<Tensor2> start = {Tensor2::Identity()};
  const std::vector<Response> reference = points.evaluate(start, Operator::elastic);
  SolverParameters parameters;
  parameters.global_operator = GlobalOperator::quasi_newton;
  PointOperators learned(parameters, reference, kPlaneStrain);
  EXPECT_NEAR(learned.acoustic_determinants(start, reference).at(0), 1, 1e-12);
  parameters.global_operator = GlobalOperator::tangent;
  const PointOperators consistent(parameters, reference, kPlaneStrain);
  const std::vector<Tensor2> F = {Tensor2(Eigen::Vector3d(1.01, 0.99, 1).asDiagonal())};
  const std::vector<Response> answer = points.evaluate(F, Operator::tangent);
  EXPECT_LT(consistent.acoustic_determinants(F, answer).at(0), 0);
  learned.begin_step(start, reference);
  learned.learn(F, answer);  // bounded from below: nearly singular at most
  EXPECT_LT(learned.acoustic_determinants(F, answer).at(0), 0.5);
  parameters.global_operator = GlobalOperator::elastic;
  EXPECT_TRUE(PointOperators(parameters, reference, kPlaneStrain).acoustic_determinants(F, answer).empty());
}

}  // namespace
}  // namespace femxdem
