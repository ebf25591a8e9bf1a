#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "analytic_laws.hpp"
#include "eigenvalues.hpp"
#include "learned_tangent.hpp"

namespace femxdem {
namespace {

const Tensor4 kC = isotropic_stiffness(400, 400);
const Tensor2 kF = (Tensor2() << 1.2, 0.3, 0, -0.1, 0.8, 0, 0, 0, 1).finished();
const Tensor2 kF_n = (Tensor2() << 1.1, 0.2, 0, 0.1, 0.9, 0, 0, 0, 1).finished();
/// Strains of 1e-3 are known to 1e-13 beside F = I; a tangent learned from them likewise.
constexpr double kRoundOff = 1e-11;
const Tensor2 kStress = (Tensor2() << 30, -12, 0, -12, -50, 0, 0, 0, -20).finished();

Tensor2 rotation(double angle) { return Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()).toRotationMatrix(); }

Tensor2 sym(const Tensor2& T) { return 0.5 * (T + T.transpose()); }

Tensor2 apply(const Tensor4& C, const Tensor2& e) {
  const Eigen::Matrix<double, 9, 1> column = C * e.reshaped<Eigen::RowMajor>();
  return column.reshaped<Eigen::RowMajor>(3, 3);
}

/// dP/dF by central differences of the first Piola-Kirchhoff stress.
template <class Stress>
Tensor4 difference_piola(const Stress& stress, const Tensor2& F) {
  const double h = 1e-6;
  Tensor4 A;
  for (int k = 0; k < 3; ++k) {
    for (int L = 0; L < 3; ++L) {
      Tensor2 up = F, down = F;
      up(k, L) += h;
      down(k, L) -= h;
      const Tensor2 slope = (first_piola(stress(up), up) - first_piola(stress(down), down)) / (2 * h);
      A.col(pair(k, L)) = slope.reshaped<Eigen::RowMajor>();
    }
  }
  return A;
}

TEST(PiolaTangent, IsTheDerivativeOfTheNominalStress) {
  const AnalyticLaw law = JaumannLaw{1000, 0.25, 0};
  const LawState state{kF_n, kStress, 0};
  LawState trial;
  const auto stress = [&](const Tensor2& F) {
    LawState unused;
    return update(law, state, F, Operator::none, unused).stress;
  };
  const Response r = update(law, state, kF, Operator::tangent, trial);
  const Tensor4 reference = difference_piola(stress, kF);
  EXPECT_LT((piola_tangent(r.stiffness, r.stress, kF) - reference).norm(), 1e-8 * reference.norm());
}

TEST(PiolaTangent, OfAStretchedElasticityIsExact) {
  const Tensor2 U_n = polar_decomposition(kF_n).U;
  const auto stress = [&](const Tensor2& F) -> Tensor2 {
    const auto [R, U] = polar_decomposition(F);
    return rotate(Tensor2(kStress + apply(kC, sym(U * U_n.inverse()))), R);
  };
  const Tensor4 reference = difference_piola(stress, kF);
  EXPECT_LT((piola_corotational(kC, stress(kF), kF, U_n) - reference).norm(), 1e-8 * reference.norm());
}

TEST(PiolaTangent, ElasticOneIsSymmetricAndThatOfAStressFreePoint) {
  const Tensor4 A = piola_elastic(kC, kF);
  EXPECT_LT((A - A.transpose()).norm(), 1e-13 * A.norm());
  EXPECT_LT((A - piola_tangent(kC, Tensor2::Zero(), kF)).norm(), 1e-13 * A.norm());
  EXPECT_LT((piola_elastic(kC, Tensor2::Identity()) - kC).norm(), 1e-12);
}

TEST(Mandel, KeepsNormsAndProducts) {
  const Tensor2 e = kStress / 1e4;
  const StrainComponents all = {0, 1, 2, 3, 4, 5};
  EXPECT_NEAR(to_mandel(e, all).norm(), e.norm(), 1e-16);
  EXPECT_LT((to_mandel(kC, all) * to_mandel(e, all) - to_mandel(apply(kC, e), all)).norm(), 1e-13);
  EXPECT_LT((from_mandel(to_mandel(kC, all), all) - kC).norm(), 1e-12);
  EXPECT_NEAR(to_mandel(kC, kPlaneStrain)(2, 2), 800, 1e-12);  // 2 G
}

// The learned tangent ------------------------------------------------------------------------------------------------

MandelMatrix matrix_of(const LearnedTangent& learned) {
  std::vector<double> values;
  learned.save(values);
  return Eigen::Map<const Eigen::Matrix3d>(values.data());
}

/// Teaches `learned` the stress law C0 scaled by `softness` along the strain e = sym(U - I), observed after a rotation.
void teach(LearnedTangent& learned, const Tensor2& e, double softness, double angle = 0) {
  const Tensor2 R = rotation(angle);
  learned.learn(R * (Tensor2::Identity() + e), rotate(Tensor2(softness * apply(kC, e)), R));
}

Tensor2 strain(double e11, double e22, double e12) {
  return (Tensor2() << e11, e12, 0, e12, e22, 0, 0, 0, 0).finished();
}

TEST(LearnedTangent, StartsElastic) {
  const LearnedTangent learned(kC, kPlaneStrain, {});
  EXPECT_LT((matrix_of(learned) - to_mandel(kC, kPlaneStrain)).norm(), 1e-12);
  EXPECT_NEAR(learned.least_eigenvalue(), 1, 1e-14);
}

TEST(LearnedTangent, AnswersTheLastIncrementAsThePointDid) {
  LearnedTangent learned(kC, kPlaneStrain, {});
  const Tensor2 e = strain(1e-3, -2e-3, 5e-4);
  teach(learned, e, 0.6);
  const MandelVector s = to_mandel(e, kPlaneStrain);
  EXPECT_LT((matrix_of(learned) * s - 0.6 * to_mandel(kC, kPlaneStrain) * s).norm(), 1e-12);
}

TEST(LearnedTangent, LearnsAsMuchAsAskedFromTheFirstTrialOfAStep) {
  LearnedTangent learned(kC, kPlaneStrain, {.first = 0.25});
  const MandelMatrix C0 = to_mandel(kC, kPlaneStrain);
  const Tensor2 e = strain(1e-3, -2e-3, 5e-4), further = strain(1e-3, -2e-3, 1e-3);
  const MandelVector s = to_mandel(e, kPlaneStrain), t = to_mandel(Tensor2(further - e), kPlaneStrain);
  teach(learned, e, 0.6);
  EXPECT_LT((matrix_of(learned) * s - 0.9 * C0 * s).norm(), kRoundOff * kC.norm());
  teach(learned, further, 0.6);
  EXPECT_LT((matrix_of(learned) * t - 0.6 * C0 * t).norm(), kRoundOff * kC.norm());
  learned.begin_step(Tensor2::Identity(), Tensor2::Zero());
  const MandelVector before = matrix_of(learned) * s;
  teach(learned, e, 0.6);
  EXPECT_LT((matrix_of(learned) * s - (0.75 * before + 0.15 * C0 * s)).norm(), kRoundOff * kC.norm());
}

TEST(LearnedTangent, ThreeOrthogonalIncrementsTeachALinearLaw) {
  LearnedTangent learned(kC, kPlaneStrain, {});
  Tensor2 e = Tensor2::Zero();
  for (const Tensor2& step : {strain(1e-3, 1e-3, 0), strain(1e-3, -1e-3, 0), strain(0, 0, 1e-3)}) {
    teach(learned, e += step, 0.5);
  }
  EXPECT_LT((matrix_of(learned) - 0.5 * to_mandel(kC, kPlaneStrain)).norm(), kRoundOff * kC.norm());
  EXPECT_NEAR(learned.least_eigenvalue(), 0.5, 1e-12);
}

/// Distance from the law 0.5 C0 after steps of three nearly parallel pairs each, whose stress scatters by a tenth.
double missed_under_scatter(double scatter) {
  LearnedTangent learned(kC, kPlaneStrain, {.skew = 10, .first = scatter > 0 ? 0.5 : 0, .scatter = scatter});
  std::mt19937 generator(7);
  const auto random = [&] { return 2.0 * generator() / static_cast<double>(std::mt19937::max()) - 1; };
  double missed = 0;
  for (int step = 0; step < 60; ++step) {
    learned.begin_step(Tensor2::Identity(), Tensor2::Zero());
    Tensor2 e = Tensor2::Zero(), stress = Tensor2::Zero();
    for (double size = 1e-3; size > 1e-5; size /= 5) {
      const Tensor2 change = size * strain(1 + 0.3 * random(), -2 + 0.3 * random(), 0.5 + 0.3 * random());
      e += change;
      stress += apply(0.5 * kC, change) + 0.1 * apply(0.5 * kC, size * strain(random(), random(), random()));
      learned.learn(Tensor2::Identity() + e, stress);
    }
    if (step >= 20) missed += (matrix_of(learned) - 0.5 * to_mandel(kC, kPlaneStrain)).norm() / 40;
  }
  return missed / kC.norm();
}

TEST(LearnedTangent, IsNotTurnedByScatterOfNearlyParallelPairs) {
  EXPECT_GT(missed_under_scatter(0), 0.08);
  EXPECT_LT(missed_under_scatter(0.1), 0.05);
}

TEST(LearnedTangent, StaysWithinItsBounds) {
  const LearningLimits limits{.min = 0.02, .max = 1.2, .skew = 0.6};
  const MandelMatrix C0 = to_mandel(kC, kPlaneStrain);
  const MandelMatrix L = C0.llt().matrixL();
  for (const double softness : {-3.0, 40.0}) {
    LearnedTangent learned(kC, kPlaneStrain, limits);
    teach(learned, strain(1e-3, -2e-3, 5e-4), softness);
    learned.learn(Tensor2::Identity() + strain(2e-3, -2e-3, 4e-4), strain(30, -80, 60));
    const MandelMatrix M = L.inverse() * matrix_of(learned) * L.inverse().transpose();
    const Eigen::VectorXd values = eigenvalues(0.5 * (M + M.transpose()));
    EXPECT_GT(values.minCoeff(), 0.02 - 1e-12);
    EXPECT_LT(values.maxCoeff(), 1.2 + 1e-12);
    EXPECT_LT((0.5 * (M - M.transpose())).norm(), 0.6 + 1e-12);
    EXPECT_NEAR(learned.least_eigenvalue(), values.minCoeff(), 1e-12);
  }
}

TEST(LearnedTangent, LearnsNothingBelowTheNoise) {
  LearnedTangent learned(kC, kPlaneStrain, {.noise = 1e-6});
  teach(learned, strain(5e-7, 0, 0), -3);
  EXPECT_LT((matrix_of(learned) - to_mandel(kC, kPlaneStrain)).norm(), 1e-12);
  teach(learned, strain(5e-6, 0, 0), 0.3);
  EXPECT_GT((matrix_of(learned) - to_mandel(kC, kPlaneStrain)).norm(), 100);
}

TEST(LearnedTangent, DoesNotFeelRotations) {
  LearnedTangent still(kC, kPlaneStrain, {}), turned(kC, kPlaneStrain, {});
  double angle = 0;
  for (const Tensor2& e : {strain(1e-3, -2e-3, 5e-4), strain(2e-3, -2e-3, 1e-3), strain(2e-3, -4e-3, 0)}) {
    teach(still, e, 0.6);
    teach(turned, e, 0.6, angle += 0.7);
  }
  EXPECT_LT((matrix_of(still) - matrix_of(turned)).norm(), kRoundOff * kC.norm());
  const Tensor2 R = rotation(0.9);
  const Tensor4 straight = still.piola(kF, kStress), rotated = turned.piola(R * kF, rotate(kStress, R));
  Eigen::Matrix<double, 9, 9> Q = Eigen::Matrix<double, 9, 9>::Zero();  // T_iJ -> R_ia T_aJ
  for (int i = 0; i < 3; ++i) {
    for (int a = 0; a < 3; ++a) {
      for (int J = 0; J < 3; ++J) Q(pair(i, J), pair(a, J)) = R(i, a);
    }
  }
  EXPECT_LT((rotated - Q * straight * Q.transpose()).norm(), kRoundOff * straight.norm());
}

TEST(LearnedTangent, ProbesGiveTheTangentOfALinearLaw) {
  LearnedTangent learned(kC, kPlaneStrain, {});
  const auto stress = [](const Tensor2& F) {
    const auto [R, U] = polar_decomposition(F);
    return rotate(Tensor2(0.3 * apply(kC, U - Tensor2::Identity())), R);
  };
  const Tensor2 F = rotation(0.4) * (Tensor2::Identity() + strain(1e-3, -2e-3, 5e-4));
  StrainProbe probe = learned.start_probe(F, stress(F), 1e-4);
  for (int component = 0; component < 3; ++component) {
    const Tensor2 probed = learned.probe(probe, F, component);
    learned.record(probe, probed, stress(probed), component);
  }
  learned.finish_probe(probe);
  EXPECT_LT((matrix_of(learned) - 0.3 * to_mandel(kC, kPlaneStrain)).norm(), 1e-8);
}

TEST(LearnedTangent, SavedOneGivesTheSameBits) {
  LearnedTangent learned(kC, kPlaneStrain, {}), restored(2 * kC, kPlaneStrain, {});
  teach(learned, strain(1e-3, -2e-3, 5e-4), 0.6);
  std::vector<double> values;
  learned.save(values);
  std::size_t position = 0;
  restored.load(values, position);
  EXPECT_EQ(position, values.size());
  learned.begin_step(kF_n, kStress);
  restored.begin_step(kF_n, kStress);
  EXPECT_EQ(learned.piola(kF, kStress), restored.piola(kF, kStress));
}

}  // namespace
}  // namespace femxdem
