#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "analytic_points.hpp"
#include "axisymmetric_q8.hpp"
#include "case.hpp"
#include "control.hpp"
#include "elastic_problem.hpp"
#include "errors.hpp"
#include "learned_tangent.hpp"
#include "loads.hpp"
#include "monitors.hpp"
#include "problem.hpp"

namespace femxdem {
namespace {

constexpr double kPi = std::numbers::pi;
const Tensor4 kC = isotropic_stiffness(400, 400);  // E = 1000, nu = 0.25

Mesh shifted(Mesh mesh, double radius) {
  for (Point2& X : mesh.nodes) X.x() += radius;
  return mesh;
}

Eigen::VectorXd displacements(const Mesh& mesh, const std::function<Point2(const Point2&)>& u) {
  Eigen::VectorXd x(2 * static_cast<Eigen::Index>(mesh.nodes.size()));
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n) x.segment<2>(2 * static_cast<Eigen::Index>(n)) = u(mesh.nodes[n]);
  return x;
}

/// Sum of the nodal forces in direction i.
double total(const Eigen::VectorXd& f, int i) {
  double sum = 0;
  for (Eigen::Index k = i; k < f.size(); k += 2) sum += f[k];
  return sum;
}

TEST(AxisymmetricQ8, PatchTestIsExactOnAnyMesh) {
  const auto u = [](const Point2& X) -> Point2 { return {2e-3 * X.x(), -3e-3 * X.y()}; };
  for (const Mesh& square : square_meshes()) {
    const Mesh mesh = shifted(square, 0.5);
    const AxisymmetricQ8 element(mesh);
    const Eigen::VectorXd exact = displacements(mesh, u);
    std::map<int, double> prescribed;
    for (const int node : boundary_nodes(mesh)) {
      for (int i = 0; i < 2; ++i) prescribed[2 * node + i] = exact[2 * node + i];
    }
    const Eigen::VectorXd x = solve_linear(element, kC, prescribed, Eigen::VectorXd::Zero(element.unknowns()));
    EXPECT_LT((x - exact).cwiseAbs().maxCoeff(), 1e-12 * exact.cwiseAbs().maxCoeff());
    const Tensor2 F = Eigen::Vector3d(1.002, 0.997, 1.002).asDiagonal();
    for (const Tensor2& of_point : element.deformation(x)) EXPECT_LT((of_point - F).norm(), 1e-14);
  }
}

/// Relative errors of the opening of a wall under a pressure of 1 against the closed form.
struct WallErrors {
  double mean, largest;
};

WallErrors wall_errors(const Mesh& mesh, const std::string& wall, const std::map<int, double>& held, double exact) {
  const AxisymmetricQ8 element(mesh);
  Loads loads(element);
  loads.add({.edge = wall, .point = {}, .kind = LoadKind::pressure, .value = 1, .table = {}});
  const Eigen::VectorXd force = loads.external_force(Eigen::VectorXd::Zero(element.unknowns()), 1);
  const Eigen::VectorXd x = solve_linear(element, kC, held, force);
  ControlParameters opening;
  opening.measure = Measure::opening;
  opening.measure_edge = wall;
  WallErrors errors{std::abs(ControlMeasure(opening, element).value(x) / exact - 1), 0};
  for (const int node : edge_nodes(mesh, wall))
    errors.largest = std::max(errors.largest, std::abs(x.segment<2>(2 * node).norm() / exact - 1));
  return errors;
}

/// Lame's long cylinder, a = 1, b = 3: u(a) = 1.484375e-3 as in the plane (element_test.cpp), and exact at the nodes.
TEST(AxisymmetricQ8, LongCylinderUnderPressureIsLames) {
  for (const int n : {2, 8}) {
    const Mesh mesh = shifted(rectangle_mesh(2, 0.5, n, 1), 1);
    std::map<int, double> held;
    for (const char* edge : {"bottom", "top"}) {
      for (const int node : edge_nodes(mesh, edge)) held[2 * node + 1] = 0;
    }
    EXPECT_LT(wall_errors(mesh, "left", held, 1.484375e-3).largest, 1e-12);
  }
}

/// Lame's sphere: u(a) = p a / E ((1 - 2 nu) a^3 + (1 + nu) b^3 / 2) / (b^3 - a^3) = 17.375 / 26000. The mean over the
/// wall is of order 4, the node on the axis, which has no weight, of order 2.6.
TEST(AxisymmetricQ8, ThickSphereUnderPressureConvergesToLame) {
  const auto errors = [](int n) {
    const Mesh mesh = annulus_mesh(1, 3, 90, n, n);
    std::map<int, double> held;
    for (const int node : edge_nodes(mesh, "start")) held[2 * node + 1] = 0;
    for (const int node : edge_nodes(mesh, "end")) held[2 * node] = 0;
    return wall_errors(mesh, "inner", held, 17.375 / 26000);
  };
  const WallErrors coarse = errors(8), fine = errors(16);
  EXPECT_LT(fine.mean, 1e-5);
  EXPECT_GT(std::log2(coarse.mean / fine.mean), 3.8);
  EXPECT_LT(fine.largest, 1.3e-4);
  EXPECT_GT(std::log2(coarse.largest / fine.largest), 2.5);
}

TEST(AxisymmetricQ8, MatrixIsTheDerivativeOfTheForce) {
  Mesh mesh = shifted(rectangle_mesh(1, 1, 1, 1), 0.3);
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n)
    mesh.nodes[n] += 0.1 * Point2(std::sin(3.0 * static_cast<double>(n)), std::cos(5.0 * static_cast<double>(n)));
  const AxisymmetricQ8 element(mesh);
  AnalyticPoints points(std::vector<AnalyticLaw>(4, JaumannLaw{1000, 0.25, 50}));
  const auto force = [&](const Eigen::VectorXd& x) {
    const auto F = element.deformation(x);
    std::vector<Tensor2> stress;
    for (const Response& r : points.evaluate(F, Operator::none)) stress.push_back(r.stress);
    return element.force(0, {x, {}, F}, stress);
  };
  Eigen::VectorXd x(16);
  for (int i = 0; i < 16; ++i) x[i] = 0.05 * std::sin(1 + 2.0 * i);
  const auto F = element.deformation(x);
  std::vector<Tensor4> dPdF;
  const auto responses = points.evaluate(F, Operator::tangent);
  for (int q = 0; q < 4; ++q) dPdF.push_back(piola_tangent(responses[q].stiffness, responses[q].stress, F[q]));
  const Eigen::MatrixXd K = element.matrix(0, {x, F, dPdF, true, 0});
  const Eigen::MatrixXd reference = difference_jacobian(force, x, 1e-6)(Eigen::all, element.dofs(0));
  EXPECT_LT((K - reference).norm(), 1e-7 * reference.norm());
}

/// Forces are those of the full circumference; a cylinder 1 < r < 2, 0 < z < 3.
TEST(AxisymmetricQ8, LoadsActOnTheFullCircumference) {
  const Mesh mesh = shifted(rectangle_mesh(1, 3, 2, 3), 1);
  const AxisymmetricQ8 element(mesh);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(element.unknowns());
  const Eigen::VectorXd wider = displacements(mesh, [](const Point2& X) -> Point2 { return {0.1 * X.x(), 0}; });
  Loads top(element), wall(element), weight(element);
  top.add({.edge = "top", .point = {}, .kind = LoadKind::traction, .component = Component::y, .value = 5, .table = {}});
  EXPECT_NEAR(total(top.external_force(wider, 1), 1), 5 * kPi * (4 - 1), 1e-12) << "dead: of the reference area";
  wall.add({.edge = "left", .point = {}, .kind = LoadKind::pressure, .value = 5, .table = {}});
  EXPECT_NEAR(total(wall.external_force(none, 1), 0), 5 * 2 * kPi * 3, 1e-12);
  EXPECT_NEAR(total(wall.external_force(wider, 1), 0), 5 * 2 * kPi * 1.1 * 3, 1e-12) << "follows the current radius";
  weight.body_force = {0, -2};
  EXPECT_NEAR(total(weight.external_force(wider, 1), 1), -2 * kPi * (4 - 1) * 3 * 1.21, 1e-11) << "per current volume";
}

TEST(AxisymmetricQ8, ControlMeasuresAreThoseOfTheCavity) {
  ControlParameters volume;
  volume.mode = ControlMode::measure;
  volume.measure = Measure::volume;
  ControlParameters opening = volume;
  opening.measure = Measure::opening;
  const auto radial = [](const Point2& X) -> Point2 { return 0.1 * X.normalized(); };

  volume.measure_edge = opening.measure_edge = "inner";
  const Mesh sphere = annulus_mesh(1, 3, 90, 2, 16);
  const AxisymmetricQ8 of_sphere(sphere);
  const double half_shell = 2 * kPi / 3 * (std::pow(1.1, 3) - 1);
  EXPECT_NEAR(ControlMeasure(volume, of_sphere).value(displacements(sphere, radial)), half_shell, 1e-5 * half_shell);
  EXPECT_NEAR(ControlMeasure(opening, of_sphere).value(displacements(sphere, radial)), 0.1, 1e-6);
  EXPECT_STREQ(ControlMeasure(volume, of_sphere).unit(), "m3");

  volume.measure_edge = "left";
  const Mesh hollow = shifted(rectangle_mesh(1, 3, 2, 3), 1);
  const AxisymmetricQ8 cylinder(hollow);
  const ControlMeasure m(volume, cylinder);
  Eigen::VectorXd x = displacements(hollow, [](const Point2& X) -> Point2 { return {0.1 * X.x(), 0.2 * X.y()}; });
  EXPECT_NEAR(m.value(x), kPi * (1.21 * 3.6 - 3), 1e-12) << "between its ends, wherever they have moved";
  for (Eigen::Index i = 0; i < x.size(); ++i) x[i] += 0.02 * std::sin(3.7 * static_cast<double>(i));
  const auto value = [&](const Eigen::VectorXd& at) { return Eigen::VectorXd::Constant(1, m.value(at)); };
  const Eigen::MatrixXd J = difference_jacobian(value, x, 1e-5);
  EXPECT_LT((J.transpose() - m.gradient(x)).norm(), 1e-9 * J.norm());
}

TEST(AxisymmetricQ8, AMeshLeftOfTheAxisIsTheUsersMistake) {
  const Mesh left = shifted(rectangle_mesh(1, 1, 1, 1), -0.1), on_axis = rectangle_mesh(1, 1, 1, 1);
  EXPECT_THROW(AxisymmetricQ8{left}, UserError);
  EXPECT_NO_THROW(AxisymmetricQ8{on_axis});
}

/// A solid cylinder, R = 0.5, h = 1, pressed by 1e-6 along its axis with a free mantle.
const char* const kCylinder = R"([mesh]
type = "rectangle"
width = 0.5
height = 1.0
nx = 2
ny = 2
[element]
type = "axisymmetric"
[material]
type = "jaumann"
young = 1e6
poisson = 0.25
[[load]]
edge = "bottom"
kind = "displacement"
component = "y"
value = 0.0
[[load]]
edge = "top"
kind = "displacement"
component = "y"
value = -1e-6
[[load]]
edge = "left"
kind = "displacement"
component = "x"
value = 0.0
[control]
end_time = 1.0
step = 0.5
[[monitor]]
name = "force"
quantity = "reaction_y"
edge = "top"
[[monitor]]
name = "radius"
quantity = "displacement_x"
edge = "right"
[[monitor]]
name = "axial"
quantity = "stress_yy"
[[monitor]]
name = "hoop"
quantity = "stress_zz"
)";

std::string file_of(const std::string& text) {
  const std::string file = testing::TempDir() + "/axisymmetric.toml";
  std::ofstream(file) << text;
  return file;
}

TEST(AxisymmetricCase, PressedCylinderGivesItsForceWithEveryOperator) {
  for (const char* op : {"tangent", "quasi_newton", "elastic", "perturbation"}) {
    const Case c = read_case(file_of(kCylinder), {std::string("solver.operator=") + op});
    Problem problem(c);
    AnalyticPoints points(problem.laws());
    NonlinearSolver& solver = problem.start(points);
    for (int i = 0; i < 2; ++i) ASSERT_TRUE(solver.solve_step(0.5).converged) << op;
    const std::vector<double> values = monitor_values(c, problem.formulation(), solver.committed());
    EXPECT_NEAR(values.at(0), -1e6 * 1e-6 * kPi * 0.25, 1e-5) << op;
    EXPECT_NEAR(values.at(1), 0.25 * 1e-6 * 0.5, 1e-11) << op;
    EXPECT_NEAR(values.at(2), -1, 1e-5) << op;
    EXPECT_NEAR(values.at(3), 0, 1e-5) << op;
  }
}

std::string mistakes_in(const std::string& text, const std::vector<std::string>& overrides) {
  try {
    read_case(file_of(text), overrides);
    return "";
  } catch (const UserError& error) {
    return error.what();
  }
}

TEST(AxisymmetricCase, WhatItDoesNotKnowIsRefused) {
  EXPECT_EQ(mistakes_in(kCylinder, {}), "") << "the hoops hold the body along x: only the axis must be";
  const auto refused = [](const std::vector<std::string>& overrides, const char* sentence) {
    const std::string said = mistakes_in(kCylinder, overrides);
    EXPECT_NE(said.find(sentence), std::string::npos) << said;
  };
  refused({"element.D=10"}, "element.D is of no use with element.type = \"axisymmetric\"; remove it");
  refused({"load.2.edge=right"}, "edge 'left' lies on the axis of axisymmetric elements, where nothing moves along x");
  refused({"load.2.kind=gradient", "load.2.component=\"11\""}, "for second-gradient elements only");
  refused({"load.0.component=x", "load.1.component=x"}, "nothing holds the mesh in y");
}

TEST(AxisymmetricCase, AMeshAcrossTheAxisIsRefused) {
  std::string text = kCylinder;
  text.replace(0, text.find("[element]"),
               "[mesh]\ntype = \"annulus\"\ninner_radius = 1\nouter_radius = 2\nangle = 180\nnr = 1\nnt = 2\n");
  const std::string said = mistakes_in(text, {"load.0.edge=start", "load.1.edge=end", "load.2.edge=inner",
                                              "monitor.0.edge=start", "monitor.1.edge=end"});
  EXPECT_NE(said.find("lies on the left of the axis x = 0 of axisymmetric elements; move the mesh to x >= 0"),
            std::string::npos)
      << said;
}

}  // namespace
}  // namespace femxdem
