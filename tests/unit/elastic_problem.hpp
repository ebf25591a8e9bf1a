#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "assembler.hpp"
#include "linear_solver.hpp"

namespace femxdem {

/// Unit square, the same sheared and stretched (affine elements), and with corners shifted at random.
inline std::vector<Mesh> square_meshes() {
  std::vector<Mesh> meshes(3, rectangle_mesh(1, 1, 4, 4));
  for (Point2& X : meshes[1].nodes) X = Point2(1.2 * X.x() + 0.4 * X.y(), 0.1 * X.x() + 0.9 * X.y());
  distort(meshes[2], 0.3, 7);
  return meshes;
}

inline std::set<int> boundary_nodes(const Mesh& mesh) {
  std::set<int> nodes;
  for (const auto& [name, sides] : mesh.edges) {
    for (const Side& side : sides) nodes.insert(side.nodes.begin(), side.nodes.end());
  }
  return nodes;
}

/// Unknowns of small-strain elasticity about F = I for prescribed unknowns and nodal forces of all unknowns [N/m];
/// penalty of the constraints [Pa].
inline Eigen::VectorXd solve_linear(const Formulation& element, const Tensor4& C,
                                    const std::map<int, double>& prescribed, const Eigen::VectorXd& force,
                                    double penalty = 0) {
  std::vector<int> fixed;
  Eigen::VectorXd x = Eigen::VectorXd::Zero(element.unknowns());
  for (const auto& [dof, value] : prescribed) {
    fixed.push_back(dof);
    x[dof] = value;
  }
  Assembler assembler(element, fixed);
  Eigen::VectorXd rhs = force(assembler.free());
  const Eigen::VectorXd reference = Eigen::VectorXd::Zero(element.unknowns());
  const std::vector<Tensor2> F(element.points(), Tensor2::Identity());
  const std::vector<Tensor4> dPdF(element.points(), C);
  const SparseMatrix& K = assembler.matrix({reference, F, dPdF, true, penalty}, x, rhs);
  LinearSolver solver;
  if (!solver.factorise(K, true)) throw std::runtime_error("singular matrix");
  x(assembler.free()) = solver.solve(rhs);
  return x;
}

/// Derivative of a vector function by central differences of step h.
template <class Function>
Eigen::MatrixXd difference_jacobian(const Function& f, const Eigen::VectorXd& x, double h) {
  Eigen::MatrixXd J;
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    Eigen::VectorXd up = x, down = x;
    up[j] += h;
    down[j] -= h;
    const Eigen::VectorXd column = (f(up) - f(down)) / (2 * h);
    if (j == 0) J.resize(column.size(), x.size());
    J.col(j) = column;
  }
  return J;
}

}  // namespace femxdem
