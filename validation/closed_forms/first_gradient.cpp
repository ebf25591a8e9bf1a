// Closed forms of the first gradient: Cook's membrane, Jaumann's rate, Rice's criterion.
#include <fmt/format.h>

#include <numbers>

#include "localisation.hpp"
#include "problem.hpp"
#include "verification.hpp"

namespace femxdem {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// Tip deflection of Cook's membrane (E = 1, nu = 1/3, plane stress, unit shear force) on n x n elements, in the limit
/// of a small load. Plane strain with E' = E (1 + 2 nu) / (1 + nu)^2 and nu' = nu / (1 + nu) has its in-plane stresses.
double cook_deflection(int n) {
  Mesh mesh = rectangle_mesh(1, 1, n, n);
  for (Point2& X : mesh.nodes) X = Point2(48 * X.x(), 44 * X.x() + X.y() * (44 - 28 * X.x()));
  Problem problem(mesh, ElasticLaw{0.9375, 0.25, 0});
  const double load = 1e-6;  // strains of 1e-6: neither finite strain nor round-off show
  problem.expect_small_strain();
  problem.loads().add({.edge = "right",
                       .point = {},
                       .kind = LoadKind::traction,
                       .component = Component::y,
                       .value = load / 16,
                       .table = {}});
  for (const int i : {0, 1}) problem.fix_u(edge_nodes(problem.mesh(), "left"), i);
  problem.solve();
  return problem.u(problem.node_at({48, 52}), 1) / load;
}

struct BiaxialEnd {
  double width, stress;
};

/// One Q8 element compressed to the height 0.7 in equal steps, its sides free.
BiaxialEnd jaumann_biaxial(int steps, const JaumannLaw& law) {
  Problem problem(rectangle_mesh(1, 1, 1, 1), law);
  problem.fix_u(edge_nodes(problem.mesh(), "bottom"), 1);
  problem.fix_u(edge_nodes(problem.mesh(), "top"), 1, -0.3);
  problem.fix_u(edge_nodes(problem.mesh(), "left"), 0);
  const Equilibrium& end = problem.solve(steps);
  return {1 + problem.u(problem.node_at({1, 0.5}), 0), end.responses.front().stress(1, 1)};
}

/// Shear stress of 2 x 2 Q8 elements in simple shear to gamma.
double jaumann_shear(int steps, double gamma, const JaumannLaw& law) {
  Problem problem(rectangle_mesh(1, 1, 2, 2), law);
  for (const char* edge : {"bottom", "right", "top", "left"}) {
    problem.fix_u(edge_nodes(problem.mesh(), edge), 0, [gamma](const Point2& X) { return gamma * X.y(); });
    problem.fix_u(edge_nodes(problem.mesh(), edge), 1);
  }
  return problem.solve(steps).responses.front().stress(0, 1);
}

/// Tangent of plane-strain Mohr-Coulomb f = (s1 - s3)/2 + (s1 + s3)/2 sin(phi), flow with psi, hardening modulus h, on
/// isotropic elasticity with E = 1; s1 (the largest stress) along x1.
Tensor4 mohr_coulomb_tangent(double poisson, double phi, double psi, double h) {
  const double G = 1 / (2 * (1 + poisson));
  const Tensor4 C = isotropic_stiffness(2 * G * poisson / (1 - 2 * poisson), G);
  const auto gradient = [](double angle) {
    Eigen::Matrix<double, 9, 1> g = Eigen::Matrix<double, 9, 1>::Zero();
    g[pair(0, 0)] = 0.5 * (1 + std::sin(angle));
    g[pair(1, 1)] = 0.5 * (-1 + std::sin(angle));
    return g;
  };
  const Eigen::Matrix<double, 9, 1> CP = C * gradient(psi), CQ = C * gradient(phi);
  return C - CP * CQ.transpose() / (h + gradient(phi).dot(CP));
}

/// Hardening modulus at which the acoustic tensor becomes singular, by bisection, and the band's inclination there.
double critical_hardening(double poisson, double phi, double psi, double* inclination) {
  double stable = 0.1, localised = -0.1;
  while (stable - localised > 1e-12) {
    const double h = 0.5 * (stable + localised);
    const bool below = min_acoustic_determinant(mohr_coulomb_tangent(poisson, phi, psi, h), inclination) < 0;
    (below ? localised : stable) = h;
  }
  return stable;
}

}  // namespace

Verification verify_cook() {
  Verification v;
  const std::vector<double> elements = {2, 4, 8, 16, 32};
  const std::vector<double> reference = {23.1707, 23.7264, 23.8883, 23.9386, 23.9565};
  std::vector<double> tips;
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const int n = static_cast<int>(elements[i]);
    tips.push_back(cook_deflection(n));
    v.add(fmt::format("tip deflection, {} x {} elements", n, n), tips.back(), reference[i], 1e-4);
  }
  v.add("tip deflection, 32 x 32, inside the published 23.91 to 23.96", tips.back(), 23.935, 0.025);
  v.figures = {{"Cook's membrane",
                "elements per side",
                "tip deflection",
                false,
                {{"Q8, 2 x 2 points", elements, tips, false},
                 {"published, lower", {2, 32}, {23.91, 23.91}, true},
                 {"published, upper", {2, 32}, {23.96, 23.96}, true}}}};
  return v;
}

Verification verify_jaumann() {
  Verification v;
  const JaumannLaw biaxial{2.6, 0.3, 0};                  // G = 1, lambda = 1.5
  const double width = 1.16516265, stress = -1.01907127;  // ln w = -lambda / (lambda + 2 G) ln h
  const std::vector<double> steps = {25, 50, 100, 200};
  std::vector<double> width_error, stress_error, shear_error;
  const double gamma = 2;
  for (const double n : steps) {
    const BiaxialEnd end = jaumann_biaxial(static_cast<int>(n), biaxial);
    width_error.push_back(std::abs(end.width - width));
    stress_error.push_back(std::abs(end.stress - stress));
    shear_error.push_back(std::abs(jaumann_shear(static_cast<int>(n), gamma, {2.5, 0.25, 0}) - std::sin(gamma)));
  }
  const auto order = [](const std::vector<double>& e) { return observed_order(e[1], e[2]); };
  const BiaxialEnd fine = jaumann_biaxial(400, biaxial);
  v.add_relative("biaxial to h = 0.7: width, 400 steps", fine.width, width, 1e-6, order(width_error));
  v.add_relative("biaxial to h = 0.7: stress, 400 steps", fine.stress, stress, 1e-6, order(stress_error));
  v.add_relative("biaxial to h = 0.7: force, 400 steps", fine.stress * fine.width, stress * width, 1e-6);
  v.add_relative("simple shear to 2: sigma_12 / G, 400 steps", jaumann_shear(400, gamma, {2.5, 0.25, 0}),
                 std::sin(gamma), 1e-5, order(shear_error));
  v.add("order of the stress in the step", order(stress_error), 2, 0.05);
  v.figures = {{"Jaumann's rate: error against the number of steps",
                "steps",
                "error / G",
                true,
                {{"biaxial, width", steps, width_error, false},
                 {"biaxial, stress", steps, stress_error, false},
                 {"simple shear, sigma_12", steps, shear_error, false},
                 {"order 2", {25, 200}, {1e-4, 1e-4 / 64}, true}}}};
  return v;
}

Verification verify_rice() {
  Verification v;
  const double phi = 30 * kDegree, psi = 10 * kDegree;
  double inclination = 0;
  for (const double poisson : {0.0, 0.25}) {
    const double h = std::pow(std::sin(phi) - std::sin(psi), 2) / (16 * (1 - poisson * poisson));
    // The scan by half degrees misses the singular direction by a quarter at most: h is low by about (0.0044)^2 / 2.
    v.add(fmt::format("critical hardening h / E, nu = {:g}", poisson),
          critical_hardening(poisson, phi, psi, &inclination), h, 2e-5);
  }
  const double theta = 0.5 * std::acos(-0.5 * (std::sin(phi) + std::sin(psi))) / kDegree;
  const double band = std::min(inclination, std::numbers::pi - inclination) / kDegree;
  v.add("inclination from the lateral axis [deg]", band, theta, 0.25);
  Curve scan{"h / E critical", {}, {}, false}, closed{"(sin phi - sin psi)^2 / (16 (1 - nu^2))", {}, {}, true};
  for (int dilatancy = 0; dilatancy <= 30; dilatancy += 2) {
    scan.x.push_back(dilatancy);
    scan.y.push_back(critical_hardening(0.25, phi, dilatancy * kDegree, &inclination));
    closed.x.push_back(dilatancy);
    closed.y.push_back(std::pow(std::sin(phi) - std::sin(dilatancy * kDegree), 2) / 15);
  }
  v.figures = {{"Mohr-Coulomb, phi = 30 deg, nu = 0.25",
                "dilatancy angle [deg]",
                "critical hardening h / E",
                false,
                {closed, scan}}};
  return v;
}

}  // namespace femxdem
