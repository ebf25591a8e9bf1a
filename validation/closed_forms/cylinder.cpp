// Thick cylinder: Lame, and the second gradient with free and with clamped walls.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "problem.hpp"
#include "verification.hpp"

namespace femxdem {
namespace {

constexpr double kInner = 1, kOuter = 3;

void symmetric(Problem& problem) {
  const auto start = edge_nodes(problem.mesh(), "start"), end = edge_nodes(problem.mesh(), "end");
  problem.fix_u(start, 1);
  problem.fix_u(end, 0);
  for (const int c : {1, 2}) {
    problem.fix_v(start, c);
    problem.fix_v(end, c);
  }
}

/// Largest relative difference from Lame's u(a) = 1.484375e-3 p at the inner wall under a pressure p = 1, second
/// gradient with free double traction (D = 0: first gradient).
double pressure_error(int n, double D) {
  const double pressure = D > 0 ? 1e-3 : 1e-4;  // strains of 1e-6 and 1e-7, about the finite-strain error that is left
  std::optional<DoubleStiffness> law;
  if (D > 0) law = one_parameter_law(D);
  Problem problem(annulus_mesh(kInner, kOuter, 90, n, n), kElastic, law);
  problem.loads().add({.edge = "inner",
                       .point = {},
                       .kind = LoadKind::pressure,
                       .component = Component::none,
                       .value = pressure,
                       .table = {}});
  symmetric(problem);
  problem.expect_small_strain();
  problem.solve();
  double error = 0;
  for (const int node : edge_nodes(problem.mesh(), "inner")) {
    const double u = std::hypot(problem.u(node, 0), problem.u(node, 1));
    error = std::max(error, std::abs(u / (1.484375e-3 * pressure) - 1));
  }
  return error;
}

constexpr double kClampedU = 0.01;

/// u = c0 r/2 + c3/r + c1 l I1(r/l) - c2 l K1(r/l) with u(a) = U, u'(a) = u(b) = u'(b) = 0.
class ClampedCylinder {
 public:
  explicit ClampedCylinder(double D) : l_(std::sqrt(D / (kLambda + 2 * kG))) {
    Eigen::Matrix4d A;
    A << values(kInner), slopes(kInner), values(kOuter), slopes(kOuter);
    c_ = A.fullPivLu().solve(Eigen::Vector4d(kClampedU, 0, 0, 0));
  }
  double u(double r) const { return values(r) * c_; }
  double slope(double r) const { return slopes(r) * c_; }

 private:
  Eigen::RowVector4d values(double r) const {
    return {r / 2, l_ * std::cyl_bessel_i(1, r / l_), -l_ * std::cyl_bessel_k(1, r / l_), 1 / r};
  }
  Eigen::RowVector4d slopes(double r) const {
    const double x = r / l_;
    return {0.5, std::cyl_bessel_i(0, x) - std::cyl_bessel_i(1, x) / x,
            std::cyl_bessel_k(0, x) + std::cyl_bessel_k(1, x) / x, -1 / (r * r)};
  }
  double l_;
  Eigen::Vector4d c_;
};

struct Clamped {
  double u_1_5, u_2, slope_1_5, u_error, slope_error;
  Curve u, slope;
};

Clamped clamped_cylinder(int nr, int nt, double D) {
  Problem problem(annulus_mesh(kInner, kOuter, 90, nr, nt), kElastic, one_parameter_law(D));
  symmetric(problem);
  problem.expect_small_strain();
  for (const char* edge : {"inner", "outer"}) {
    const double U = std::string(edge) == "inner" ? kSmall * kClampedU : 0;
    const auto nodes = edge_nodes(problem.mesh(), edge);
    for (int i = 0; i < 2; ++i) problem.fix_u(nodes, i, [&](const Point2& X) { return U * X[i] / X.norm(); });
    for (int c = 0; c < 4; ++c) {  // v = u/r t (x) t, t = (-y, x) / r
      problem.fix_v(nodes, c, [&](const Point2& X) {
        const Point2 t = Point2(-X.y(), X.x()) / X.norm();
        return U / X.norm() * t[c / 2] * t[c % 2];
      });
    }
  }
  problem.solve();
  const ClampedCylinder exact(D);
  const auto at = [&](double r) { return problem.node_at({r, 0}); };
  const auto slope = [&](double r) { return problem.second_gradient().micro_gradient(at(r))[0] / kSmall; };
  Clamped result{problem.u(at(1.5), 0) / kSmall, problem.u(at(2), 0) / kSmall, slope(1.5), 0, 0, {}, {}};
  result.u.label = result.slope.label = fmt::format("{} x {}", nr, nt);
  for (int k = 0; k <= nr; ++k) {
    const double r = kInner + (kOuter - kInner) * k / nr;
    result.u.x.push_back(r);
    result.u.y.push_back(problem.u(at(r), 0) / kSmall);
    result.slope.x.push_back(r);
    result.slope.y.push_back(slope(r));
    result.u_error = std::max(result.u_error, std::abs(result.u.y.back() - exact.u(r)) / kClampedU);
    result.slope_error = std::max(result.slope_error, std::abs(result.slope.y.back() - exact.slope(r)));
  }
  return result;
}

}  // namespace

Verification verify_cylinder() {
  Verification v;
  const double q8_coarse = pressure_error(8, 0), q8_fine = pressure_error(16, 0);
  v.add("Lame, first gradient, 8 x 8: error of u(a)", q8_coarse, 0, 4e-5);
  v.add("Lame, first gradient, 16 x 16: error of u(a)", q8_fine, 0, 3e-6, observed_order(q8_coarse, q8_fine));
  const double coarse = pressure_error(8, 10), fine = pressure_error(16, 10);
  v.add("null test, D = 10, 8 x 8: error of u(a)", coarse, 0, 4e-4);
  v.add("null test, D = 10, 16 x 16: error of u(a)", fine, 0, 1e-4, observed_order(coarse, fine));
  const Clamped one = clamped_cylinder(16, 12, 48), two = clamped_cylinder(32, 24, 48);
  v.add("clamped, D = 48, 32 x 24: u(1.5)", two.u_1_5, 6.899316413e-3, 4e-3 * kClampedU);
  v.add("clamped, D = 48, 32 x 24: u(2)", two.u_2, 3.648860633e-3, 4e-3 * kClampedU);
  v.add_relative("clamped, D = 48, 32 x 24: u'(1.5)", two.slope_1_5, -7.472646739e-3, 0.01);
  v.add("clamped, D = 48, 32 x 24: largest error of u / U", two.u_error, 0, 5e-3,
        observed_order(one.u_error, two.u_error));
  v.add("clamped, D = 48, 32 x 24: largest error of v_rr", two.slope_error, 0, 6e-5,
        observed_order(one.slope_error, two.slope_error));
  const Clamped thin = clamped_cylinder(32, 24, 10);
  v.add("clamped, D = 10, 32 x 24: u(1.5)", thin.u_1_5, 6.234247681e-3, 1e-2 * kClampedU);
  v.add("clamped, D = 10, 32 x 24: u(2)", thin.u_2, 3.360453053e-3, 1e-2 * kClampedU);
  const ClampedCylinder exact(48);
  Curve u{"closed form", {}, {}, true}, slope = u;
  for (int i = 0; i <= 200; ++i) {
    const double r = kInner + (kOuter - kInner) * i / 200;
    u.x.push_back(r);
    slope.x.push_back(r);
    u.y.push_back(exact.u(r));
    slope.y.push_back(exact.slope(r));
  }
  v.figures = {{"clamped gradient, D = 48", "r", "u", false, {u, one.u, two.u}},
               {"clamped gradient, D = 48", "r", "v_rr", false, {slope, one.slope, two.slope}}};
  return v;
}

}  // namespace femxdem
