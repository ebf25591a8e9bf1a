// Closed forms of the second gradient in one direction: shear layer, softening bar; the published element.
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "problem.hpp"
#include "verification.hpp"

namespace femxdem {
namespace {

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

}  // namespace

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
