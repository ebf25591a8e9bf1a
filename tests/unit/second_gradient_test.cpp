#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "analytic_points.hpp"
#include "eigenvalues.hpp"
#include "elastic_problem.hpp"
#include "learned_tangent.hpp"
#include "second_gradient_q8.hpp"

namespace femxdem {
namespace {

constexpr double kLambda = 400, kG = 400;  // E = 1000, nu = 0.25
const Tensor4 kC = isotropic_stiffness(kLambda, kG);
constexpr double kD = 4;

using Rotation = Eigen::Matrix2d;
Rotation rotation(double angle) { return Eigen::Rotation2Dd(angle).toRotationMatrix(); }

/// R_ia R_jb R_kc T_abc.
DoubleStress rotated(const DoubleStress& T, const Rotation& R) {
  DoubleStress result = DoubleStress::Zero();
  for (int row = 0; row < 8; ++row) {
    for (int c = 0; c < 8; ++c) {
      result[row] += R(row / 4, c / 4) * R(row / 2 % 2, c / 2 % 2) * R(row % 2, c % 2) * T[c];
    }
  }
  return result;
}

DoubleStress numbered(double phase) {
  DoubleStress T;
  for (int c = 0; c < 8; ++c) T[c] = std::sin(phase + 2.3 * c);
  return T;
}

/// w_ijk = u_i,jk of a quadratic field, symmetric in jk.
DoubleStress second_gradient(double u1_11, double u1_12, double u1_22, double u2_11, double u2_12, double u2_22) {
  return (DoubleStress() << u1_11, u1_12, u1_12, u1_22, u2_11, u2_12, u2_12, u2_22).finished();
}
const DoubleStress kGeneral = second_gradient(0.3, -0.7, 1.1, 0.4, 0.9, -0.2);
const std::vector<DoubleStress> kKernel = {second_gradient(1, 0, -1, 0, -1, 0), second_gradient(0, 1, 0, 1, 0, -1)};

Point2 quadratic(const DoubleStress& w, const Point2& X) {
  Point2 u;
  for (int i = 0; i < 2; ++i) {
    u[i] = 0.5 * (w[4 * i] * X.x() * X.x() + 2 * w[4 * i + 1] * X.x() * X.y() + w[4 * i + 3] * X.y() * X.y());
  }
  return u;
}

Eigen::Vector4d gradient_of_quadratic(const DoubleStress& w, const Point2& X) {
  Eigen::Vector4d v;
  for (int c = 0; c < 4; ++c) v[c] = w[2 * c] * X.x() + w[2 * c + 1] * X.y();
  return v;
}

/// Unknowns of the fields u(X) and v(X) at all nodes.
Eigen::VectorXd unknowns_of(const SecondGradientQ8& element, const std::function<Point2(const Point2&)>& u,
                            const std::function<Eigen::Vector4d(const Point2&)>& v) {
  Eigen::VectorXd x(element.unknowns());
  for (int n = 0; n < static_cast<int>(element.mesh().nodes.size()); ++n) {
    const Point2& X = element.mesh().nodes[n];
    x.segment<2>(2 * n) = u(X);
    if (element.gradient_dof(n, 0) >= 0) x.segment<4>(element.gradient_dof(n, 0)) = v(X);
  }
  return x;
}

/// Solution with u and v prescribed on the boundary to their exact values.
Eigen::VectorXd solve_inside(const SecondGradientQ8& element, const Eigen::VectorXd& exact,
                             const Eigen::VectorXd& force) {
  std::map<int, double> prescribed;
  for (const int node : boundary_nodes(element.mesh())) {
    for (int i = 0; i < 2; ++i) prescribed[2 * node + i] = exact[2 * node + i];
    for (int c = 0; c < 4; ++c) {
      const int dof = element.gradient_dof(node, c);
      if (dof >= 0) prescribed[dof] = exact[dof];
    }
  }
  return solve_linear(element, kC, prescribed, force, 1e5);
}

// The law ------------------------------------------------------------------------------------------------------------

/// Collin, Chambon, Charlier (2006), matrix of the law with one parameter.
TEST(DoubleStressLaw, IsThePrintedMatrix) {
  Eigen::Matrix<double, 8, 8> printed;
  printed << 1, 0, 0, 0, 0, .5, .5, 0,  //
      0, .5, .5, 0, -.5, 0, 0, .5,      //
      0, .5, .5, 0, -.5, 0, 0, .5,      //
      0, 0, 0, 1, 0, -.5, -.5, 0,       //
      0, -.5, -.5, 0, 1, 0, 0, 0,       //
      .5, 0, 0, -.5, 0, .5, .5, 0,      //
      .5, 0, 0, -.5, 0, .5, .5, 0,      //
      0, .5, .5, 0, 0, 0, 0, 1;
  EXPECT_EQ(one_parameter_law(kD), DoubleStiffness(kD * printed));
  EXPECT_EQ(mindlin_law({kD / 2, 0, 0, kD / 2, -kD / 2}), one_parameter_law(kD));
  // In the plane only four of the five constants are independent.
  const double t = 0.37;
  EXPECT_LT((mindlin_law({kD / 2 + t, -2 * t, t, kD / 2 - t, -kD / 2 + t}) - one_parameter_law(kD)).norm(), 1e-14);
}

TEST(DoubleStressLaw, IsIsotropicSymmetricAndOfRankFour) {
  const Rotation R = rotation(0.7);
  for (const DoubleStiffness& law : {one_parameter_law(kD), mindlin_law({1.3, 0.4, 0.7, 1.9, 0.6})}) {
    EXPECT_LT((law * rotated(numbered(1), R) - rotated(law * numbered(1), R)).norm(), 1e-13);
    EXPECT_LT((law - law.transpose()).norm(), 1e-14);
  }
  const Eigen::VectorXd values = eigenvalues(one_parameter_law(kD)) / kD;
  const DoubleStress expected = (DoubleStress() << 0, 0, 0, 0, 1, 1, 2, 2).finished();
  EXPECT_LT((values - expected).norm(), 1e-14);
}

/// Power of a compatible field: D/2 (|grad div u|^2 + |grad rot u|^2); none for two quadratic fields.
TEST(DoubleStressLaw, EnergyIsThatOfDivergenceAndRotation) {
  const DoubleStress& w = kGeneral;
  const double div_1 = w[0] + w[5], div_2 = w[2] + w[7], rot_1 = w[4] - w[1], rot_2 = w[6] - w[3];
  const double energy = 0.5 * w.dot(one_parameter_law(kD) * w);
  EXPECT_NEAR(energy, kD / 2 * (div_1 * div_1 + div_2 * div_2 + rot_1 * rot_1 + rot_2 * rot_2), 1e-13);
  for (const DoubleStress& kernel : kKernel) EXPECT_EQ((one_parameter_law(kD) * kernel).norm(), 0);
}

// Its objective update -----------------------------------------------------------------------------------------------

TEST(DoubleStressUpdate, RigidRotationTurnsTheDoubleStress) {
  const DoubleStress start = numbered(0.4);
  const Eigen::Matrix2d F_n = (Eigen::Matrix2d() << 1.2, 0.3, -0.1, 0.8).finished();
  for (const double angle : {0.3, -1.5, 3.0}) {
    const Rotation R = rotation(angle);
    const auto turned =
        update_double_stress(one_parameter_law(kD), R * F_n, F_n, DoubleStress::Zero(), start, false).sigma;
    EXPECT_LT((turned - rotated(start, R)).norm(), 1e-12);
  }
}

TEST(DoubleStressUpdate, WithoutDeformationItIsTheLaw) {
  const auto I = Eigen::Matrix2d::Identity();
  const auto updated = update_double_stress(one_parameter_law(kD), I, I, kGeneral, numbered(2), false);
  EXPECT_LT((updated.sigma - numbered(2) - one_parameter_law(kD) * kGeneral).norm(), 1e-14);
  EXPECT_LT((updated.T - updated.sigma).norm(), 1e-15);
}

/// Jaumann's rate in simple shear turns the double stress by half the shear: error of n equal steps.
double shear_error(int steps) {
  const double gamma = 2;
  DoubleStress sigma = numbered(1);
  Eigen::Matrix2d F = Eigen::Matrix2d::Identity();
  for (int i = 1; i <= steps; ++i) {
    Eigen::Matrix2d next = Eigen::Matrix2d::Identity();
    next(0, 1) = gamma * i / steps;
    sigma = update_double_stress(one_parameter_law(kD), next, F, DoubleStress::Zero(), sigma, false).sigma;
    F = next;
  }
  return (sigma - rotated(numbered(1), rotation(-gamma / 2))).norm();
}

TEST(DoubleStressUpdate, IsSecondOrderInTheStep) {
  EXPECT_LT(shear_error(40), 1e-3);
  EXPECT_NEAR(std::log2(shear_error(20) / shear_error(40)), 2, 0.02);
}

TEST(DoubleStressUpdate, DerivativesAreExact) {
  const Eigen::Matrix2d F_n = (Eigen::Matrix2d() << 1.2, 0.3, -0.1, 0.8).finished();
  Eigen::VectorXd at(12);
  at << 1.1, 0.5, 0.1, 0.7, 0.3 * numbered(3);
  const auto T = [&](const Eigen::VectorXd& p, bool derivatives) {
    Eigen::Matrix2d F;
    F << p[0], p[1], p[2], p[3];
    return update_double_stress(one_parameter_law(kD), F, F_n, p.tail<8>(), numbered(1), derivatives);
  };
  const Eigen::MatrixXd J =
      difference_jacobian([&](const Eigen::VectorXd& p) { return Eigen::VectorXd(T(p, false).T); }, at, 1e-6);
  const DoublePiola exact = T(at, true);
  EXPECT_LT((exact.dT_dF - J.leftCols<4>()).norm(), 1e-8 * J.norm());
  EXPECT_LT((exact.dT_dH - J.rightCols<8>()).norm(), 1e-8 * J.norm());
  EXPECT_EQ(exact.T, T(at, false).T);
}

/// The symmetric operator is the exact one where the step has not deformed yet.
TEST(DoubleStressUpdate, SimplifiedOperatorIsThatOfTheStartOfTheStep) {
  const Eigen::Matrix2d F = (Eigen::Matrix2d() << 1.2, 0.3, -0.1, 0.8).finished();
  const auto simple = update_double_stress(one_parameter_law(kD), F, F, kGeneral, numbered(1), false);
  const auto exact = update_double_stress(one_parameter_law(kD), F, F, kGeneral, numbered(1), true);
  EXPECT_LT((simple.dT_dH - exact.dT_dH).norm(), 1e-13 * exact.dT_dH.norm());
  EXPECT_LT((simple.dT_dH - simple.dT_dH.transpose()).norm(), 1e-13);
}

// The element --------------------------------------------------------------------------------------------------------

TEST(SecondGradientQ8, PatchWithConstantGradientIsExactOnAnyMesh) {
  const Eigen::Matrix2d A = (Eigen::Matrix2d() << 1e-3, 2e-3, -3e-3, 4e-3).finished();
  for (const Mesh& mesh : square_meshes()) {
    SecondGradientQ8 element(mesh, one_parameter_law(kD));
    const Eigen::VectorXd exact = unknowns_of(
        element, [&](const Point2& X) -> Point2 { return A * X; },
        [&](const Point2&) { return Eigen::Vector4d(A(0, 0), A(0, 1), A(1, 0), A(1, 1)); });
    Eigen::VectorXd x = solve_inside(element, exact, Eigen::VectorXd::Zero(element.unknowns()));
    EXPECT_LT((x - exact).cwiseAbs().maxCoeff(), 1e-12 * exact.cwiseAbs().maxCoeff());
    EXPECT_LT(element.constraint_gap(x), 1e-12);
    element.commit(x);
    for (std::size_t p = 0; p < element.points(); ++p) EXPECT_LT(element.double_stress(p).norm(), 1e-12 * kD);
  }
}

/// u_i = w_ijk x_j x_k / 2 and v_ij = w_ijk x_k under the body force b_i = -sigma_ij,j; power of b by 2 x 2 Gauss
/// points.
TEST(SecondGradientQ8, PatchWithLinearGradientIsExactOnAffineElements) {
  const auto meshes = square_meshes();
  for (const DoubleStress& w : {kGeneral, kKernel[0], kKernel[1]}) {
    for (int m = 0; m < 2; ++m) {
      SecondGradientQ8 element(meshes[m], one_parameter_law(kD));
      const Eigen::VectorXd exact = unknowns_of(
          element, [&](const Point2& X) { return quadratic(w, X); },
          [&](const Point2& X) { return gradient_of_quadratic(w, X); });
      const Point2 b(-(kG * (w[0] + w[3] + w[0] + w[5]) + kLambda * (w[0] + w[5])),
                     -(kG * (w[4] + w[7] + w[2] + w[7]) + kLambda * (w[2] + w[7])));
      Eigen::VectorXd force = Eigen::VectorXd::Zero(element.unknowns());
      for (std::size_t p = 0; p < element.points(); ++p) {
        const QuadraturePoint& g = gauss_2x2()[p % kPointsPerElement];
        const Shape8 N = shape_q8(g.xi, g.eta);
        for (int a = 0; a < 8; ++a) {
          force.segment<2>(2 * meshes[m].elements[p / kPointsPerElement][a]) += element.shapes(p).weight * N[a] * b;
        }
      }
      const Eigen::VectorXd x = solve_inside(element, exact, force);
      EXPECT_LT((x - exact).cwiseAbs().maxCoeff(), 1e-12 * exact.cwiseAbs().maxCoeff());
    }
  }
}

TEST(SecondGradientQ8, LinearMicroGradientGivesTheLawsDoubleStress) {
  for (const Mesh& mesh : square_meshes()) {
    for (const DoubleStress& w : {kGeneral, kKernel[0], kKernel[1]}) {
      SecondGradientQ8 element(mesh, one_parameter_law(kD));
      Eigen::VectorXd x = unknowns_of(
          element, [](const Point2&) -> Point2 { return Point2::Zero(); },
          [&](const Point2& X) { return gradient_of_quadratic(w, X); });
      element.commit(x);
      for (std::size_t p = 0; p < element.points(); ++p) {
        EXPECT_LT((element.double_stress(p) - one_parameter_law(kD) * w).norm(), 1e-12 * kD * w.norm());
      }
    }
  }
}

TEST(SecondGradientQ8, RigidRotationOfTheMeshTurnsItsDoubleStress) {
  const Mesh mesh = square_meshes()[2];
  SecondGradientQ8 body(mesh, one_parameter_law(kD));
  Eigen::VectorXd x = unknowns_of(
      body, [](const Point2& X) -> Point2 { return 0.1 * quadratic(kGeneral, X); },
      [](const Point2& X) { return gradient_of_quadratic(0.1 * kGeneral, X); });
  body.commit(x);
  std::vector<DoubleStress> before;
  for (std::size_t p = 0; p < body.points(); ++p) before.push_back(body.double_stress(p));
  const Rotation R = rotation(1.1);
  const Eigen::Matrix2d G = R - Eigen::Matrix2d::Identity();
  for (int n = 0; n < static_cast<int>(mesh.nodes.size()); ++n) {
    x.segment<2>(2 * n) = R * (mesh.nodes[n] + x.segment<2>(2 * n)) - mesh.nodes[n];
    if (body.gradient_dof(n, 0) >= 0) x.segment<4>(body.gradient_dof(n, 0)) << G(0, 0), G(0, 1), G(1, 0), G(1, 1);
  }
  EXPECT_LT(body.constraint_gap(x), 1e-12);
  body.commit(x);
  for (std::size_t p = 0; p < body.points(); ++p) {
    EXPECT_LT((body.double_stress(p) - rotated(before[p], R)).norm(), 1e-12 * before[p].norm());
  }
}

Eigen::MatrixXd free_matrix(const Formulation& element) {
  Assembler assembler(element, {});
  Eigen::VectorXd rhs = Eigen::VectorXd::Zero(element.unknowns());
  const std::vector<Tensor2> F(element.points(), Tensor2::Identity());
  return assembler.matrix({rhs, F, std::vector<Tensor4>(element.points(), kC), true, 800}, rhs, rhs);
}

int zero_modes(const Mesh& mesh) {
  const Eigen::MatrixXd K = free_matrix(SecondGradientQ8(mesh, one_parameter_law(kD)));
  const Eigen::VectorXd values = eigenvalues(K);
  return static_cast<int>((values.array() < 1e-10 * values.maxCoeff()).count());
}

TEST(SecondGradientQ8, OnlyOneFreeElementHasSpuriousModes) {
  EXPECT_EQ(zero_modes(rectangle_mesh(1, 1, 1, 1)), 3 + 5);  // hourglass, and four of v in the kernel of the law
  EXPECT_EQ(zero_modes(rectangle_mesh(1, 1, 2, 2)), 3);
  EXPECT_EQ(zero_modes(rectangle_mesh(1, 4, 1, 8)), 3);
  EXPECT_EQ(zero_modes(square_meshes()[2]), 3);
}

/// One distorted element with a committed finite strain, double stress and multiplier, and a second finite increment.
TEST(SecondGradientQ8, MatrixIsTheDerivativeOfTheForceAtFiniteStrain) {
  Mesh mesh = rectangle_mesh(1, 1, 1, 1);
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n) {
    mesh.nodes[n] += 0.1 * Point2(std::sin(3.0 * static_cast<double>(n)), std::cos(5.0 * static_cast<double>(n)));
  }
  SecondGradientQ8 element(mesh, one_parameter_law(300));
  AnalyticPoints points(std::vector<AnalyticLaw>(4, JaumannLaw{1000, 0.25, 50}));
  const auto increment = [&](double phase) {
    Eigen::VectorXd dx(32);
    for (int i = 0; i < 32; ++i) dx[i] = 0.12 * std::sin(phase + 2.0 * i);
    return dx;
  };
  const double penalty = 2000;
  Eigen::VectorXd x = increment(1);
  points.evaluate(element.deformation(x), Operator::none);
  points.commit();
  const Eigen::VectorXd lambda = element.updated_multipliers(Eigen::VectorXd::Zero(4), x, penalty);
  element.commit(x);
  ASSERT_GT(element.double_stress(0).norm(), 10);
  ASSERT_GT(lambda.norm(), 10);

  x += increment(2.5);
  const auto force = [&](const Eigen::VectorXd& at) -> Eigen::VectorXd {
    const auto F = element.deformation(at);
    std::vector<Tensor2> stress;
    for (const Response& r : points.evaluate(F, Operator::none)) stress.push_back(r.stress);
    return element.force(0, {at, lambda, F}, stress) + element.constraint_force(0, at, penalty);
  };
  const auto F = element.deformation(x);
  const auto responses = points.evaluate(F, Operator::tangent);
  std::vector<Tensor4> dPdF;
  for (int q = 0; q < 4; ++q) dPdF.push_back(piola_tangent(responses[q].stiffness, responses[q].stress, F[q]));
  const Eigen::MatrixXd K = element.matrix(0, {x, F, dPdF, true, penalty});
  const Eigen::MatrixXd all = difference_jacobian(force, x, 1e-6);
  Eigen::MatrixXd reference(32, 32);
  const std::vector<int> dofs = element.dofs(0);
  for (int j = 0; j < 32; ++j) reference.col(j) = all.col(dofs[j]);
  for (const int row : {0, 16}) {
    for (const int column : {0, 16}) {
      const auto block = reference.block<16, 16>(row, column);
      EXPECT_LT((K.block<16, 16>(row, column) - block).norm(), 1e-6 * block.norm()) << row << " " << column;
    }
  }
}

TEST(SecondGradientQ8, MicroGradientLivesAtTheCorners) {
  const Mesh mesh = rectangle_mesh(2, 1, 2, 1);
  const SecondGradientQ8 element(mesh, one_parameter_law(kD));
  EXPECT_EQ(element.unknowns(), 2 * 13 + 4 * 6);
  for (int a = 0; a < 8; ++a) EXPECT_EQ(element.gradient_dof(mesh.elements[0][a], 0) >= 0, a < 4);
  EXPECT_EQ(element.residual_length(0), 1);
  EXPECT_EQ(element.residual_length(element.unknowns() - 1), 1);  // mean element size [m]
}

TEST(SecondGradientQ8, SavedStateGivesTheSameBits) {
  const Mesh mesh = square_meshes()[2];
  SecondGradientQ8 element(mesh, one_parameter_law(kD)), restored(mesh, one_parameter_law(kD));
  Eigen::VectorXd x(element.unknowns());
  for (int i = 0; i < x.size(); ++i) x[i] = 0.01 * std::sin(1 + 2.0 * i);
  const Eigen::VectorXd next = 1.7 * x, lambda = Eigen::VectorXd::LinSpaced(element.multipliers(), -1, 2);
  element.commit(x);
  NamedArrays arrays;
  element.save(arrays);
  restored.load(arrays);
  EXPECT_EQ(element.start(), restored.start());
  const auto F = element.deformation(next);
  const std::vector<Tensor2> stress(element.points(), Tensor2::Identity());
  for (int e = 0; e < 16; ++e) {
    EXPECT_EQ(element.force(e, {next, lambda, F}, stress), restored.force(e, {next, lambda, F}, stress));
    EXPECT_EQ(element.constraint_force(e, next, 1e3), restored.constraint_force(e, next, 1e3));
  }
  EXPECT_EQ(element.micro_gradient(0), restored.micro_gradient(0));
}

}  // namespace
}  // namespace femxdem
