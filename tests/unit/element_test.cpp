#include <gtest/gtest.h>

#include <cmath>

#include "analytic_points.hpp"
#include "eigenvalues.hpp"
#include "elastic_problem.hpp"
#include "errors.hpp"
#include "learned_tangent.hpp"
#include "loads.hpp"
#include "plane_strain_q8.hpp"

namespace femxdem {
namespace {

const Tensor4 kC = isotropic_stiffness(400, 400);  // E = 1000, nu = 0.25

std::map<int, double> prescribe_on_boundary(const Mesh& mesh, const std::function<Point2(const Point2&)>& u) {
  std::map<int, double> prescribed;
  for (const int node : boundary_nodes(mesh)) {
    for (int i = 0; i < 2; ++i) prescribed[2 * node + i] = u(mesh.nodes[node])[i];
  }
  return prescribed;
}

double largest_error(const Mesh& mesh, const Eigen::VectorXd& x, const std::function<Point2(const Point2&)>& u) {
  double error = 0, size = 0;
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n) {
    const Point2 exact = u(mesh.nodes[n]);
    error = std::max(error, (x.segment<2>(2 * static_cast<int>(n)) - exact).norm());
    size = std::max(size, exact.norm());
  }
  return error / size;
}

/// Matrix of all unknowns about the reference configuration.
Eigen::MatrixXd free_matrix(const Formulation& element) {
  Assembler assembler(element, {});
  Eigen::VectorXd rhs = Eigen::VectorXd::Zero(element.unknowns());
  const std::vector<Tensor2> F(element.points(), Tensor2::Identity());
  const std::vector<Tensor4> dPdF(element.points(), kC);
  return assembler.matrix({rhs, F, dPdF, true, 0}, rhs, rhs);
}

int zero_modes(const Eigen::MatrixXd& K) {
  const Eigen::VectorXd values = eigenvalues(K);
  return static_cast<int>((values.array() < 1e-10 * values.maxCoeff()).count());
}

TEST(ReferenceElement, ShapeFunctionsAreNodal) {
  const double xi[] = {-1, 1, 1, -1, 0, 1, 0, -1}, eta[] = {-1, -1, 1, 1, -1, 0, 1, 0};
  for (int b = 0; b < 8; ++b) {
    EXPECT_LT((shape_q8(xi[b], eta[b]) - Shape8::Unit(b)).norm(), 1e-15);
    if (b < 4) {
      EXPECT_LT((shape_q4(xi[b], eta[b]) - Eigen::Vector4d::Unit(b)).norm(), 1e-15);
    }
  }
  for (int b = 0; b < 3; ++b) EXPECT_LT((shape_edge(b - 1.0) - Eigen::Vector3d::Unit(b)).norm(), 1e-15);
}

TEST(ReferenceElement, GradientsAreTheSlopesOfTheShapes) {
  const Eigen::Vector2d at(0.3, -0.7);
  const auto q8 = [](const Eigen::VectorXd& s) { return Eigen::VectorXd(shape_q8(s[0], s[1])); };
  const auto q4 = [](const Eigen::VectorXd& s) { return Eigen::VectorXd(shape_q4(s[0], s[1])); };
  const auto edge = [](const Eigen::VectorXd& s) { return Eigen::VectorXd(shape_edge(s[0])); };
  EXPECT_LT((shape_gradient_q8(0.3, -0.7) - difference_jacobian(q8, at, 1e-5)).norm(), 1e-9);
  EXPECT_LT((shape_gradient_q4(0.3, -0.7) - difference_jacobian(q4, at, 1e-5)).norm(), 1e-9);
  EXPECT_LT((shape_gradient_edge(0.3) - difference_jacobian(edge, at.head<1>(), 1e-5)).norm(), 1e-9);
}

TEST(Q8, PatchTestIsExactOnAnyMesh) {
  const Eigen::Matrix2d A = (Eigen::Matrix2d() << 1e-3, 2e-3, -3e-3, 4e-3).finished();
  const auto u = [&](const Point2& X) -> Point2 { return A * X; };
  for (const Mesh& mesh : square_meshes()) {
    const PlaneStrainQ8 element(mesh);
    const Eigen::VectorXd x =
        solve_linear(element, kC, prescribe_on_boundary(mesh, u), Eigen::VectorXd::Zero(element.unknowns()));
    EXPECT_LT(largest_error(mesh, x, u), 1e-12);
    for (const Tensor2& F : element.deformation(x)) {
      EXPECT_LT((F.topLeftCorner<2, 2>() - Eigen::Matrix2d::Identity() - A).norm(), 1e-12 * A.norm());
      EXPECT_EQ(F(2, 2), 1);
    }
  }
}

/// Pure bending of a block, free of body forces: u = (-k x y, k x^2 / 2 + k nu / (1 - nu) y^2 / 2), plane strain.
TEST(Q8, PureBendingIsExactOnAffineElements) {
  const double nu = 0.25, k = 1e-3;
  const auto u = [&](const Point2& X) -> Point2 {
    return {-k * X.x() * X.y(), 0.5 * k * X.x() * X.x() + 0.5 * k * nu / (1 - nu) * X.y() * X.y()};
  };
  const auto meshes = square_meshes();
  for (int m = 0; m < 2; ++m) {
    const PlaneStrainQ8 element(meshes[m]);
    const Eigen::VectorXd x =
        solve_linear(element, kC, prescribe_on_boundary(meshes[m], u), Eigen::VectorXd::Zero(element.unknowns()));
    EXPECT_LT(largest_error(meshes[m], x, u), 1e-12);
  }
}

TEST(Q8, OneElementHasOneHourglassModeTwoHaveNone) {
  const Mesh one = rectangle_mesh(1, 1, 1, 1), two = rectangle_mesh(2, 1, 2, 1);
  EXPECT_EQ(zero_modes(free_matrix(PlaneStrainQ8(one))), 3 + 1);  // rigid motions, and the hourglass
  EXPECT_EQ(zero_modes(free_matrix(PlaneStrainQ8(two))), 3);
  Mesh distorted = rectangle_mesh(1, 1, 3, 3);
  distort(distorted, 0.3, 3);
  EXPECT_EQ(zero_modes(free_matrix(PlaneStrainQ8(distorted))), 3);
}

/// Lame: u(a) = p a (1 + nu) / E (b^2 + (1 - 2 nu) a^2) / (b^2 - a^2) = 1.484375e-3 for a, b, p, E, nu = 1, 3, 1, 1000,
/// 1/4.
double lame_error(int n) {
  const Mesh mesh = annulus_mesh(1, 3, 90, n, n);
  const PlaneStrainQ8 element(mesh);
  std::map<int, double> prescribed;
  for (const int node : edge_nodes(mesh, "start")) prescribed[2 * node + 1] = 0;
  for (const int node : edge_nodes(mesh, "end")) prescribed[2 * node] = 0;
  Loads loads(element);
  loads.add({.edge = "inner", .point = {}, .kind = LoadKind::pressure, .value = 1, .table = {}});
  const Eigen::VectorXd force = loads.external_force(Eigen::VectorXd::Zero(element.unknowns()), 1);
  const Eigen::VectorXd x = solve_linear(element, kC, prescribed, force);
  double error = 0;
  for (const int node : edge_nodes(mesh, "inner")) {
    error = std::max(error, std::abs(x.segment<2>(2 * node).norm() / 1.484375e-3 - 1));
  }
  return error;
}

TEST(Q8, ThickCylinderUnderPressureConvergesToLame) {
  const double coarse = lame_error(8), fine = lame_error(16);
  EXPECT_LT(coarse, 4e-5);
  EXPECT_LT(fine, 3e-6);
  EXPECT_GT(std::log2(coarse / fine), 3.5);
}

TEST(Q8, MatrixIsTheDerivativeOfTheForce) {
  Mesh mesh = rectangle_mesh(1, 1, 1, 1);
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n) {
    mesh.nodes[n] += 0.1 * Point2(std::sin(3.0 * static_cast<double>(n)), std::cos(5.0 * static_cast<double>(n)));
  }
  const PlaneStrainQ8 element(mesh);
  AnalyticPoints points(std::vector<AnalyticLaw>(4, JaumannLaw{1000, 0.25, 50}));
  const auto force = [&](const Eigen::VectorXd& x) {
    const auto F = element.deformation(x);
    std::vector<Tensor2> stress;
    for (const Response& r : points.evaluate(F, Operator::none)) stress.push_back(r.stress);
    return element.force(0, {x, {}, F}, stress);
  };
  const std::vector<int> dofs = element.dofs(0);
  Eigen::VectorXd x(16);
  for (int i = 0; i < 16; ++i) x[i] = 0.15 * std::sin(1 + 2.0 * i);
  const auto F = element.deformation(x);
  std::vector<Tensor4> dPdF;
  const auto responses = points.evaluate(F, Operator::tangent);
  for (int q = 0; q < 4; ++q) dPdF.push_back(piola_tangent(responses[q].stiffness, responses[q].stress, F[q]));
  const Eigen::MatrixXd K = element.matrix(0, {x, F, dPdF, true, 0});
  const Eigen::MatrixXd all = difference_jacobian(force, x, 1e-6);
  Eigen::MatrixXd reference(16, 16);
  for (int j = 0; j < 16; ++j) reference.col(j) = all.col(dofs[j]);
  EXPECT_LT((K - reference).norm(), 1e-7 * reference.norm());
}

TEST(Q8, RigidMotionLeavesOnlyTheRotation) {
  const Mesh mesh = square_meshes()[2];
  const PlaneStrainQ8 element(mesh);
  const Eigen::Rotation2Dd R(0.8);
  Eigen::VectorXd x(element.unknowns());
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n) {
    x.segment<2>(2 * static_cast<int>(n)) = R * mesh.nodes[n] - mesh.nodes[n] + Point2(3, -2);
  }
  for (const Tensor2& F : element.deformation(x)) {
    EXPECT_LT((F.topLeftCorner<2, 2>() - R.toRotationMatrix()).norm(), 1e-13);
  }
}

TEST(Q8, TurnedInsideOutIsTheUsersMistake) {
  Mesh mesh = rectangle_mesh(1, 1, 1, 1);
  auto& nodes = mesh.elements[0];
  nodes = {nodes[0], nodes[3], nodes[2], nodes[1], nodes[7], nodes[6], nodes[5], nodes[4]};
  EXPECT_THROW(PlaneStrainQ8{mesh}, UserError);
}

}  // namespace
}  // namespace femxdem
