#include "analytic_points.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "errors.hpp"
#include "material_points_contract.hpp"

namespace femxdem {
namespace {

const VonMisesLaw kStrong{.young = 1000, .poisson = 0.25, .yield_stress = 6, .hardening = -40, .residual_stress = 2};

std::vector<AnalyticLaw> one_of_each() {
  VonMisesLaw weak = kStrong;
  weak.yield_stress = 3;
  return {ElasticLaw{1000, 0.25, 2},
          JaumannLaw{1000, 0.25, 2},
          kStrong,
          weak,
          DruckerPragerLaw{.young = 1000, .poisson = 0.25, .cohesion = 2, .friction_angle = 0.5, .initial_pressure = 3},
          BilinearLaw{.A1 = 100, .A2 = -10, .limit_strain = 0.01}};
}

/// The same plane-strain gradient at every point, t times a stretch with shear.
std::vector<Tensor2> strained(std::size_t points, double t) {
  Tensor2 F = Tensor2::Identity();
  F(0, 0) += 0.05 * t;
  F(0, 1) += 0.03 * t;
  F(1, 1) -= 0.06 * t;
  return std::vector<Tensor2>(points, F);
}

std::vector<Tensor2> stresses(MaterialPoints& points, double t, Operator wanted = Operator::none) {
  std::vector<Tensor2> result;
  for (const Response& response : points.evaluate(strained(points.size(), t), wanted)) {
    EXPECT_FALSE(response.failure.has_value());
    EXPECT_EQ(response.stiffness.allFinite(), wanted != Operator::none);
    result.push_back(response.stress);
  }
  return result;
}

TEST(AnalyticPoints, TheOperatorAskedForDoesNotTouchTheStress) {
  AnalyticPoints points(one_of_each());
  for (const double t : {0.1, 0.5, 1.0}) {
    const auto plain = stresses(points, t, Operator::none);
    EXPECT_EQ(plain, stresses(points, t, Operator::elastic));
    EXPECT_EQ(plain, stresses(points, t, Operator::tangent));
    points.commit();
  }
}

TEST(AnalyticPoints, KeepTheContractOfMaterialPoints) {
  // At strains beyond yield. A rotation on top of a strain in ONE increment is left to the order of the increment; the
  // rotation of a committed state is exact (analytic_laws_test.cpp).
  const contract::Tolerances tolerances{.strain = 0.02};
  for (const auto& part :
       {contract::check_repetition, contract::check_rejection, contract::check_saving, contract::check_bad_gradients}) {
    AnalyticPoints points(one_of_each());
    part(points, tolerances);
  }
  AnalyticPoints straight({ElasticLaw{1000, 0.25, 2}, FailingLaw{1000, 0.25, 1}, BilinearLaw{100, -10, 0.01}});
  contract::check_continuation(straight, {.strain = 0.02, .path = 1e-12});
}

TEST(AnalyticPoints, OtherStatesThanItsOwnAreRefused) {
  const SavedStates saved = AnalyticPoints(one_of_each()).save();
  EXPECT_THROW(AnalyticPoints({kStrong}).load(saved), UserError);
  EXPECT_THROW(AnalyticPoints({kStrong}).load({"a volume element"}), UserError);
}

TEST(AnalyticPoints, EachPointHasItsOwnParameters) {
  AnalyticPoints points(one_of_each());
  const auto sigma = stresses(points, 0.1);
  EXPECT_GT((sigma[2] - sigma[3]).norm(), 1);
}

TEST(AnalyticPoints, InitialPressureIsTheStressAtRest) {
  AnalyticPoints points(one_of_each());
  const auto sigma = stresses(points, 0);
  for (const std::size_t i : {0, 1}) EXPECT_LT((sigma[i] + 2 * Tensor2::Identity()).norm(), 1e-15);
  EXPECT_LT((sigma[4] + 3 * Tensor2::Identity()).norm(), 1e-15);
}

TEST(AnalyticPoints, ElasticOperatorIsSymmetricInBothPairs) {
  AnalyticPoints points(one_of_each());
  stresses(points, 0.5);
  points.commit();
  for (const Response& response : points.evaluate(strained(points.size(), 1), Operator::elastic)) {
    const Tensor4& C = response.stiffness;
    for (const auto& [i, j] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
      EXPECT_EQ(C.row(pair(i, j)), C.row(pair(j, i)));
      EXPECT_EQ(C.col(pair(i, j)), C.col(pair(j, i)));
    }
  }
}

TEST(AnalyticPoints, FailuresAreValuesThatNameThePoint) {
  const std::vector<AnalyticLaw> laws(4, kStrong);
  AnalyticPoints points(laws);
  std::vector<Tensor2> F = strained(4, 1);
  F[1](0, 0) = -1;
  F[2](0, 1) = std::numeric_limits<double>::quiet_NaN();
  F[3] = Eigen::Vector3d(-1, -1, 1).asDiagonal();  // half a turn in one step
  const std::vector<Response> responses = points.evaluate(F, Operator::tangent);
  EXPECT_FALSE(responses[0].failure.has_value());
  for (std::size_t i = 1; i < 4; ++i) {
    ASSERT_TRUE(responses[i].failure.has_value());
    EXPECT_EQ(responses[i].failure->point, i);
    EXPECT_FALSE(responses[i].failure->sentence.empty());
    EXPECT_FALSE(responses[i].failure->advice.empty());
    EXPECT_TRUE(std::isnan(responses[i].stress(0, 0)));
  }
}

TEST(AnalyticPoints, TheFailingLawFailsAtItsStrainOnly) {
  AnalyticPoints points({FailingLaw{.young = 1000, .poisson = 0.25, .failing_strain = 0.03}});
  EXPECT_FALSE(points.evaluate(strained(1, 0.49), Operator::none)[0].failure.has_value());
  EXPECT_TRUE(points.evaluate(strained(1, 0.51), Operator::none)[0].failure.has_value());
}

TEST(AnalyticPoints, ParametersOutOfBoundsAreNamed) {
  const auto complaint = [](const AnalyticLaw& law) -> std::string {
    try {
      AnalyticPoints points({law});
    } catch (const UserError& error) {
      return error.what();
    }
    return "";
  };
  const auto names = [&](const std::string& key, const AnalyticLaw& law) {
    EXPECT_NE(complaint(law).find(key), std::string::npos) << key;
  };
  names("young", ElasticLaw{0, 0.25});
  names("young", ElasticLaw{std::numeric_limits<double>::quiet_NaN(), 0.25});
  names("poisson", JaumannLaw{1, 0.5});
  names("yield_stress", VonMisesLaw{1, 0.25, 0});
  names("residual_stress", VonMisesLaw{1, 0.25, 1, 0, -1});
  names("dilatancy_angle", DruckerPragerLaw{1, 0.25, 1, 0.3, 0.4});
  names("friction_angle", DruckerPragerLaw{1, 0.25, 1, 2});
  names("A2", BilinearLaw{1, 2, 0.1});
  names("limit_strain", BilinearLaw{1, -1, 0});
  // 3 G + hardening = 0 is the limit for von Mises: 3 G = 1200
  names("keep it above -1200", VonMisesLaw{1000, 0.25, 1, -1200});
  EXPECT_EQ(complaint(VonMisesLaw{1000, 0.25, 1, -1199}), "");
}

}  // namespace
}  // namespace femxdem
