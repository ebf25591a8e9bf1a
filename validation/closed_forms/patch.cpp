// Patch tests of the second gradient.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "problem.hpp"
#include "verification.hpp"

namespace femxdem {
namespace {

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

}  // namespace femxdem
