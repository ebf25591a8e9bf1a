#include "saddle.hpp"

#include <algorithm>

#include "loads.hpp"
#include "second_gradient_q8.hpp"

namespace femxdem {

MixedProblem::MixedProblem(int nx, int ny, double D)
    : mesh(rectangle_mesh(1, 2, nx, ny)), C(isotropic_stiffness(400, 400)), D(D) {
  for (const char* edge : {"bottom", "top"}) {
    for (const int node : edge_nodes(mesh, edge)) prescribed.push_back(2 * node + 1);
  }
  prescribed.push_back(2 * edge_nodes(mesh, "bottom").front());
  std::sort(prescribed.begin(), prescribed.end());
}

SparseMatrix MixedProblem::augmented(double r) const {
  const SecondGradientQ8 element(mesh, one_parameter_law(D));
  Assembler assembler(element, prescribed);
  Eigen::VectorXd zero = Eigen::VectorXd::Zero(element.unknowns());
  Eigen::VectorXd rhs = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(assembler.free().size()));
  const std::vector<Tensor2> F(element.points(), Tensor2::Identity());
  return assembler.matrix({zero, F, std::vector<Tensor4>(element.points(), C), false, r}, zero, rhs);
}

SparseMatrix MixedProblem::saddle(double scale) const {
  const SparseMatrix K = augmented(0);
  const SecondGradientQ8 element(mesh, one_parameter_law(D));
  std::vector<int> equation(element.unknowns(), -1);
  const Assembler assembler(element, prescribed);
  for (std::size_t i = 0; i < assembler.free().size(); ++i) equation[assembler.free()[i]] = static_cast<int>(i);
  std::vector<Eigen::Triplet<double>> entries;
  for (int j = 0; j < K.outerSize(); ++j) {
    for (SparseMatrix::InnerIterator it(K, j); it; ++it) entries.emplace_back(it.row(), it.col(), it.value());
  }
  const int n = static_cast<int>(K.rows()), multipliers = 4 * static_cast<int>(mesh.elements.size());
  const auto add = [&](int row, int dof, double value) {
    if (equation[dof] < 0) return;
    entries.emplace_back(n + row, equation[dof], scale * value);
    entries.emplace_back(equation[dof], n + row, scale * value);
  };
  for (std::size_t p = 0; p < element.points(); ++p) {
    const int e = static_cast<int>(p / kPointsPerElement);
    const PointShapes& s = element.shapes(p);
    for (int c = 0; c < 4; ++c) {
      for (int a = 0; a < 8; ++a) add(4 * e + c, 2 * mesh.elements[e][a] + c / 2, -s.weight * s.dN8(a, c % 2));
      for (int a = 0; a < 4; ++a) add(4 * e + c, element.gradient_dof(mesh.elements[e][a], c), s.weight * s.N4[a]);
    }
  }
  SparseMatrix S(n + multipliers, n + multipliers);
  S.setFromTriplets(entries.begin(), entries.end());
  return S;
}

}  // namespace femxdem
