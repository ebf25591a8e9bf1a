// Closed forms of the second gradient: patches, shear layer, softening bar, thick cylinder, the published element.
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "problem.hpp"
#include "verification.hpp"

namespace femxdem {
namespace {

/// The closed forms are those of small strain: they are compared in the limit of displacements scaled by this.
constexpr double kSmall = 1e-6;

const ElasticLaw kElastic{1000, 0.25, 0};  // lambda = G = 400
constexpr double kG = 400, kLambda = 400;

std::vector<Mesh> patch_meshes(int n) {
  std::vector<Mesh> meshes(3, rectangle_mesh(1, 1, n, n));
  for (Point2& X : meshes[1].nodes) X = Point2(1.2 * X.x() + 0.4 * X.y(), 0.1 * X.x() + 0.9 * X.y());
  distort(meshes[2], 0.3, 7);
  return meshes;
}

std::vector<int> boundary(const Mesh& mesh) {
  std::vector<int> nodes;
  for (const auto& [name, sides] : mesh.edges) {
    for (const int node : edge_nodes(mesh, name)) nodes.push_back(node);
  }
  return nodes;
}

struct PatchErrors {
  double u = 0, v = 0;  // largest, over the largest value
};

/// u and v against u(X) and v_c(X) at all nodes.
template <class U, class V>
PatchErrors patch_errors(Problem& problem, const U& u, const V& v) {
  PatchErrors errors;
  double largest_u = 0, largest_v = 0;
  for (const int node : problem.all_nodes()) {
    const Point2& X = problem.mesh().nodes[node];
    for (int i = 0; i < 2; ++i) {
      errors.u = std::max(errors.u, std::abs(problem.u(node, i) - u(i, X)));
      largest_u = std::max(largest_u, std::abs(u(i, X)));
    }
    if (problem.element().gradient_dof(node, 0) < 0) continue;
    const Eigen::Vector4d computed = problem.second_gradient().micro_gradient(node);
    for (int c = 0; c < 4; ++c) {
      errors.v = std::max(errors.v, std::abs(computed[c] - v(c, X)));
      largest_v = std::max(largest_v, std::abs(v(c, X)));
    }
  }
  return {errors.u / largest_u, errors.v / largest_v};
}

template <class U, class V>
PatchErrors solve_patch(const Mesh& mesh, const U& u, const V& v, const BodyForce& b, bool small) {
  Problem problem(mesh, kElastic, one_parameter_law(4));
  if (small) {
    problem.expect_small_strain();
  } else {
    problem.parameters.tolerance = 1e-11;
    problem.parameters.displacement_tolerance = 1e-14;
  }
  problem.loads().body_force = b;
  for (int i = 0; i < 2; ++i) {
    problem.fix_u(boundary(mesh), i, [&](const Point2& X) { return u(i, X); });
  }
  for (int c = 0; c < 4; ++c) {
    problem.fix_v(boundary(mesh), c, [&](const Point2& X) { return v(c, X); });
  }
  problem.solve();
  return patch_errors(problem, u, v);
}

PatchErrors constant_patch(const Mesh& mesh) {
  const std::array<double, 4> A = {0.1, 0.05, -0.08, 0.12};  // a finite strain: exact all the same
  return solve_patch(
      mesh, [&](int i, const Point2& X) { return A[2 * i] * X.x() + A[2 * i + 1] * X.y(); },
      [&](int c, const Point2&) { return A[c]; }, {}, false);
}

PatchErrors linear_patch(const Mesh& mesh) {
  const std::array<double, 8> w = {0.3, -0.7, -0.7, 1.1, 0.4, 0.9, 0.9, -0.2};  // u_i,jk
  const auto u = [&](int i, const Point2& X) {
    return 0.5 * kSmall * (w[4 * i] * X.x() * X.x() + 2 * w[4 * i + 1] * X.x() * X.y() + w[4 * i + 3] * X.y() * X.y());
  };
  const auto v = [&](int c, const Point2& X) { return kSmall * (w[2 * c] * X.x() + w[2 * c + 1] * X.y()); };
  const double div_1 = w[0] + w[5], div_2 = w[2] + w[7];
  return solve_patch(mesh, u, v,
                     {-kSmall * (kG * (w[0] + w[3] + div_1) + kLambda * div_1),
                      -kSmall * (kG * (w[4] + w[7] + div_2) + kLambda * div_2)},
                     true);
}

// Shear layer --------------------------------------------------------------------------------------------------------

struct Layer {
  double traction, mid_gradient, double_stress_error, gradient_error;
  Curve gradient;
};

constexpr double kLayerD = 4, kLayerU = 0.01;
const double kLength = std::sqrt(kLayerD / kG);
const double kPlateau = kLayerU / (1 - 2 * kLength * std::tanh(0.5 / kLength));

double layer_gradient(double y) { return kPlateau * (1 - std::cosh((y - 0.5) / kLength) / std::cosh(0.5 / kLength)); }
double layer_double_stress(double y) {
  return -kLayerD * kPlateau / kLength * std::sinh((y - 0.5) / kLength) / std::cosh(0.5 / kLength);
}

Layer shear_layer(int n) {
  const double width = 1.0 / n;
  Problem problem(rectangle_mesh(width, 1, 1, n), kElastic, one_parameter_law(kLayerD));
  const auto bottom = edge_nodes(problem.mesh(), "bottom"), top = edge_nodes(problem.mesh(), "top");
  problem.fix_u(problem.all_nodes(), 1);
  for (const int c : {0, 2, 3}) problem.fix_v(problem.all_nodes(), c);
  problem.fix_u(bottom, 0);
  problem.fix_u(top, 0, kSmall * kLayerU);
  problem.fix_v(bottom, 1);
  problem.fix_v(top, 1);
  problem.solve();
  Layer layer{problem.reaction(top, 0) / width / kSmall, 0, 0, 0, {fmt::format("{} elements", n), {}, {}, false}};
  const SecondGradientQ8& element = problem.second_gradient();
  for (int k = 0; k <= n; ++k) {
    const double y = static_cast<double>(k) / n;
    const double g = element.micro_gradient(problem.node_at({0, y}))[1] / kSmall;
    layer.gradient.x.push_back(y);
    layer.gradient.y.push_back(g);
    layer.gradient_error = std::max(layer.gradient_error, std::abs(g - layer_gradient(y)) / kPlateau);
    if (2 * k == n) layer.mid_gradient = g;
  }
  for (int k = 0; k < n; ++k) {  // v is linear within an element: its slope is second order at the centre
    const double exact = layer_double_stress((k + 0.5) / n);
    const double error = std::abs(element.double_stress(kPointsPerElement * k)[3] / kSmall - exact);
    layer.double_stress_error = std::max(layer.double_stress_error, error / layer_double_stress(0));
  }
  return layer;
}

// Softening bar ------------------------------------------------------------------------------------------------------

struct BarCase {
  double A1, A2, D, L, limit_strain, U;
  double weakness;  ///< of the middle element: its limit strain is lower by so much [-]
};

/// The bar's nominal stress is its Cauchy stress: only the step's rotation-free update knows finite strain.
constexpr double kBarScale = 1e-3;

struct Bar {
  double force, width, largest_strain;
  Curve strain;
};

/// Localised solution of Chambon, Caillerie and El Hassan (1998), one soft patch in the middle, ends free of double
/// force: tan(omega w / 2) = -sqrt(|A2| / A1) tanh(k (L - w) / 2).
Bar bar_solution(const BarCase& b) {
  const double soft = -b.A2, omega = std::sqrt(soft / b.D), k = std::sqrt(b.A1 / b.D), pi = std::acos(-1.0);
  double low = pi / omega, high = std::min(2 * pi / omega, b.L);
  while (high - low > 1e-14) {
    const double w = 0.5 * (low + high);
    const bool beyond = std::tan(omega * w / 2) > -std::sqrt(soft / b.A1) * std::tanh(k * (b.L - w) / 2);
    (beyond ? high : low) = w;
  }
  const double w = low, q_length = w / soft - 2 / (omega * soft) * std::tan(omega * w / 2) - (b.L - w) / b.A1 +
                                   2 / (k * b.A1) * std::tanh(k * (b.L - w) / 2);
  const double q = (b.U - b.limit_strain * b.L) / q_length;
  Bar bar{b.A1 * b.limit_strain - q, w, 0, {"closed form", {}, {}, true}};
  for (int i = 0; i <= 400; ++i) {
    const double x = b.L * (i / 400.0 - 0.5), a = std::abs(x);
    const double e =
        a < w / 2 ? b.limit_strain + q / soft * (1 - std::cos(omega * x) / std::cos(omega * w / 2))
                  : b.limit_strain - q / b.A1 * (1 - std::cosh(k * (b.L / 2 - a)) / std::cosh(k * (b.L - w) / 2));
    bar.strain.x.push_back(x);
    bar.strain.y.push_back(e / b.limit_strain);
    bar.largest_strain = std::max(bar.largest_strain, e);
  }
  return bar;
}

/// Distance between the two points where the nodal micro gradient crosses the limit strain.
double patch_width(const Curve& strain) {
  double ends[2] = {0, 0};
  int found = 0;
  for (std::size_t i = 0; i + 1 < strain.x.size(); ++i) {
    const double a = strain.y[i] - 1, b = strain.y[i + 1] - 1;
    if (a * b < 0 && found < 2) ends[found++] = strain.x[i] + (strain.x[i + 1] - strain.x[i]) * a / (a - b);
  }
  return ends[1] - ends[0];
}

Bar solve_bar(const BarCase& b, int n) {
  const BilinearLaw law{b.A1, b.A2, kBarScale * b.limit_strain, 0, 0};
  BilinearLaw weak = law;
  weak.limit_strain *= 1 - b.weakness;
  Problem problem(rectangle_mesh(b.L, b.L / n, n, 1), law, one_parameter_law(b.D));
  problem.set_law(n / 2, weak);
  problem.fix_u(problem.all_nodes(), 1);
  for (const int c : {1, 2, 3}) problem.fix_v(problem.all_nodes(), c);
  problem.fix_u(edge_nodes(problem.mesh(), "left"), 0);
  problem.fix_u(edge_nodes(problem.mesh(), "right"), 0, kBarScale * b.U);
  problem.expect_small_strain();
  problem.parameters.max_iterations = 20;
  NonlinearSolver& solver = problem.start();
  const double before_peak = 0.99 * b.limit_strain * b.L / b.U, largest = (1 - before_peak) / 40;
  Problem::require_converged(solver.solve_step(before_peak), 0);
  for (double dt = largest; solver.committed().time < 1 - 1e-12;) {
    const StepResult result = solver.solve_step(std::min(dt, 1 - solver.committed().time));
    dt = result.converged ? std::min(1.5 * dt, largest) : dt / 2;  // Newton may cycle on the kink
    if (dt < 1e-6 * largest) Problem::require_converged(result, 1);
  }
  Bar bar{problem.reaction(edge_nodes(problem.mesh(), "right"), 0) / (b.L / n) / kBarScale,
          0,
          0,
          {fmt::format("{} elements", n), {}, {}, false}};
  for (int i = 0; i <= n; ++i) {
    const double X = b.L * i / n;
    const double e = problem.second_gradient().micro_gradient(problem.node_at({X, 0}))[0] / kBarScale;
    bar.strain.x.push_back(X - b.L / 2);
    bar.strain.y.push_back(e / b.limit_strain);
    bar.largest_strain = std::max(bar.largest_strain, e);
  }
  bar.width = patch_width(bar.strain);
  return bar;
}

// Thick cylinder -----------------------------------------------------------------------------------------------------

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

Verification verify_patch() {
  Verification v;
  const std::array<const char*, 3> names = {"regular", "parallelogram", "distorted"};
  for (int m = 0; m < 3; ++m) {
    const PatchErrors constant = constant_patch(patch_meshes(4)[m]);
    v.add(fmt::format("(i) v = A, finite strain, {} mesh: largest error of u", names[m]), constant.u, 0, 1e-12);
    v.add(fmt::format("(i) v = A, finite strain, {} mesh: largest error of v", names[m]), constant.v, 0, 1e-12);
  }
  for (int m = 0; m < 2; ++m) {
    const PatchErrors linear = linear_patch(patch_meshes(4)[m]);
    v.add(fmt::format("(ii) v linear, {} mesh: largest error of u", names[m]), linear.u, 0, 10 * kSmall);
    v.add(fmt::format("(ii) v linear, {} mesh: largest error of v", names[m]), linear.v, 0, 10 * kSmall);
  }
  Figure figure{"patch (ii) on distorted meshes", "elements per side", "largest error", true, {}};
  Curve u{"u", {}, {}, false}, gradient{"v", {}, {}, false};
  for (const int n : {4, 8, 16, 32}) {
    const PatchErrors errors = linear_patch(patch_meshes(n)[2]);
    u.x.push_back(n);
    u.y.push_back(errors.u);
    gradient.x.push_back(n);
    gradient.y.push_back(errors.v);
  }
  v.add("(ii) distorted, 32 x 32: largest error of u", u.y[3], 0, 1e-3, observed_order(u.y[1], u.y[3], 4));
  v.add("(ii) distorted, 32 x 32: largest error of v", gradient.y[3], 0, 1e-2,
        observed_order(gradient.y[1], gradient.y[3], 4));
  figure.curves = {u, gradient};
  v.figures = {figure};
  return v;
}

Verification verify_shear_layer() {
  Verification v;
  const Layer coarse = shear_layer(5), middle = shear_layer(20), fine = shear_layer(80);
  const double tau = kG * kPlateau;
  const auto error = [&](const Layer& layer) { return layer.traction - tau; };
  v.add_relative("tau, 20 elements", middle.traction, tau, 5e-6, observed_order(error(coarse), error(middle), 4));
  v.add_relative("tau, 80 elements", fine.traction, tau, 5e-7, observed_order(error(middle), error(fine), 4));
  v.add_relative("gradient at mid-height, 80 elements", fine.mid_gradient, layer_gradient(0.5), 5e-4);
  v.add("largest error of v_12 / plateau, 20 elements", middle.gradient_error, 0, 9e-3,
        observed_order(coarse.gradient_error, middle.gradient_error, 4));
  v.add("largest error of v_12 / plateau, 80 elements", fine.gradient_error, 0, 6e-4,
        observed_order(middle.gradient_error, fine.gradient_error, 4));
  v.add("largest error of Sigma_122 / Sigma_122(0), 80 elements", fine.double_stress_error, 0, 2e-3,
        observed_order(middle.double_stress_error, fine.double_stress_error, 4));
  Curve exact{"closed form", {}, {}, true};
  for (int i = 0; i <= 200; ++i) {
    exact.x.push_back(i / 200.0);
    exact.y.push_back(layer_gradient(i / 200.0));
  }
  const std::vector<double> n = {5, 20, 80};
  std::vector<double> tau_errors;
  for (const Layer* layer : {&coarse, &middle, &fine}) tau_errors.push_back(std::abs(error(*layer)) / tau);
  v.figures = {{"gradient across the layer", "y / H", "v_12", false, {exact, coarse.gradient, middle.gradient}},
               {"convergence",
                "elements",
                "relative error",
                true,
                {{"tau", n, tau_errors, false},
                 {"v_12", n, {coarse.gradient_error, middle.gradient_error, fine.gradient_error}, false},
                 {"order 2", {5, 80}, {1e-4, 1e-4 / 256}, true}}}};
  return v;
}

Verification verify_bilinear_bar() {
  Verification v;
  const BarCase base{100, -10, 0.04, 1, 0.01, 0.0102, 1e-3}, steep{100, -50, 0.1, 0.5, 0.01, 0.00505, 3e-3};
  BarCase quarter_D = base;
  quarter_D.D = base.D / 4;
  const auto rows = [&](const std::string& name, const BarCase& b, int coarse, int fine) {
    const Bar exact = bar_solution(b), one = solve_bar(b, coarse), two = solve_bar(b, fine);
    for (const Bar* bar : {&one, &two}) {
      const std::string where = name + ", " + bar->strain.label;
      v.add_relative(where + ": force", bar->force, exact.force, 1e-3);
      v.add_relative(where + ": width of the band", bar->width, exact.width, 0.02);
      v.add_relative(where + ": largest strain", bar->largest_strain, exact.largest_strain, 5e-3);
    }
    v.figures.push_back({name, "x", "strain / e_l", false, {exact.strain, one.strain, two.strain}});
    return two.width;
  };
  const double wide = rows("D = 0.04, A2 = -10", base, 41, 81);
  const double narrow = rows("D = 0.01, A2 = -10", quarter_D, 81, 161);
  rows("D = 0.1, A2 = -50, L = 0.5", steep, 41, 81);
  v.add_relative("width at 4 D over width at D", wide / narrow, 2, 0.03);
  return v;
}

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

/// code_aster, test SSLL117f (V3.01.117): one element [-1, 1]^2, E = 1000, nu = 0, a1 = 10, u_1 = 0.1 at x = -1.
Verification verify_single_element() {
  Mesh mesh = rectangle_mesh(2, 2, 1, 1);
  for (Point2& X : mesh.nodes) X -= Point2(1, 1);
  Problem problem(mesh, ElasticLaw{1000, 0, 0}, mindlin_law({10, 0, 0, 0, 0}));
  problem.fix_u(problem.all_nodes(), 1);
  problem.fix_u(edge_nodes(mesh, "right"), 0);
  problem.fix_u(edge_nodes(mesh, "left"), 0, 0.1 * kSmall);
  for (const int c : {0, 3}) problem.fix_v(edge_nodes(mesh, "right"), c);
  for (const int c : {1, 2}) problem.fix_v(problem.all_nodes(), c);
  const Equilibrium& end = problem.solve();
  const SecondGradientQ8& element = problem.second_gradient();
  double v_11 = 0;  // at the first Gauss point, nearest to (-1, -1)
  for (int a = 0; a < 4; ++a) {
    v_11 += element.shapes(0).N4[a] * element.micro_gradient(mesh.elements[0][a])[0];
  }
  const double strain = end.F[0](0, 0) - 1;
  Verification v;
  v.add("v_11 at (-1, -1)", element.micro_gradient(problem.node_at({-1, -1}))[0] / kSmall, -0.1, 1e-6);
  v.add("u_1 at (0, -1)", problem.u(problem.node_at({0, -1}), 0) / kSmall, 0.05, 1e-6);
  v.add("Sigma_111", element.double_stress(0)[0] / kSmall, 1, 1e-6);
  v.add("Sigma_221", element.double_stress(0)[6] / kSmall, 0.5, 1e-6);
  v.add("(grad u - v)_11 at the first Gauss point", (strain - v_11) / kSmall, 0.05 / std::sqrt(3.0), 1e-6);
  v.add("strain_11", strain / kSmall, -0.05, 1e-6);
  const std::vector<double> x = {-1, 1};
  v.figures = {{"the published element along y = -1",
                "x",
                "",
                false,
                {{"v_11, published", x, {-0.1, 0}, true},
                 {"v_11",
                  x,
                  {element.micro_gradient(problem.node_at({-1, -1}))[0] / kSmall,
                   element.micro_gradient(problem.node_at({1, -1}))[0] / kSmall},
                  false},
                 {"u_1, published", {-1, 0, 1}, {0.1, 0.05, 0}, true},
                 {"u_1",
                  {-1, 0, 1},
                  {problem.u(problem.node_at({-1, -1}), 0) / kSmall, problem.u(problem.node_at({0, -1}), 0) / kSmall,
                   problem.u(problem.node_at({1, -1}), 0) / kSmall},
                  false}}}};
  return v;
}

}  // namespace femxdem
