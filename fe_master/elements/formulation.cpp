#include "formulation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "edge_samples.hpp"
#include "errors.hpp"

namespace femxdem {
namespace {

PointShapes point_shapes(const Mesh& mesh, std::size_t e, const QuadraturePoint& g) {
  Eigen::Matrix<double, 8, 2> X;
  for (int a = 0; a < 8; ++a) X.row(a) = mesh.nodes[mesh.elements[e][a]].transpose();
  const Shape8 N8 = shape_q8(g.xi, g.eta);
  const Gradient8 dN8 = shape_gradient_q8(g.xi, g.eta);
  const Eigen::Matrix2d J = X.transpose() * dN8;  // dX_i / dxi_j
  const double det = J.determinant();
  if (!(det > 0)) {
    throw UserError(
        fmt::format("mesh: element {} is turned inside out at a Gauss point (determinant {:.3g}); "
                    "number its nodes counter-clockwise and keep its mid-side nodes near the middle",
                    e, det));
  }
  const Eigen::Matrix2d inverse = J.inverse();
  return {g.weight * det,    N8, dN8 * inverse, shape_q4(g.xi, g.eta), shape_gradient_q4(g.xi, g.eta) * inverse,
          X.transpose() * N8};
}

/// Rows 3 i + J of dF from which the components of strain come.
std::vector<int> gradient_rows(const StrainComponents& components) {
  constexpr std::array<std::array<int, 2>, 6> kPairs = {{{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}}};
  std::set<int> rows;
  for (const int c : components) {
    const auto [i, j] = kPairs[c];
    rows.insert({pair(i, j), pair(j, i)});
  }
  return {rows.begin(), rows.end()};
}

}  // namespace

Formulation::Formulation(const Mesh& mesh, StrainComponents components, MicroGradient micro_gradient)
    : mesh_(mesh), components_(std::move(components)), rows_(gradient_rows(components_)) {
  shapes_.reserve(mesh.elements.size() * kPointsPerElement);
  double area = 0;
  for (std::size_t e = 0; e < mesh.elements.size(); ++e) {
    for (const QuadraturePoint& g : gauss_2x2()) {
      shapes_.push_back(point_shapes(mesh, e, g));
      area += shapes_.back().weight;
    }
  }
  mean_size_ = std::sqrt(area / static_cast<double>(mesh.elements.size()));
  unknowns_ = 2 * static_cast<int>(mesh.nodes.size());
  if (micro_gradient == MicroGradient::at_corners) {
    corner_.assign(mesh.nodes.size(), -1);
    int corners = 0;
    for (const auto& nodes : mesh.elements) {
      for (int a = 0; a < 4; ++a) {
        if (corner_[nodes[a]] < 0) corner_[nodes[a]] = corners++;
      }
    }
    unknowns_ += 4 * corners;
  }
  start_ = Eigen::VectorXd::Zero(unknowns_);
}

std::vector<int> Formulation::dofs(int e) const {
  std::vector<int> dofs;
  for (const int node : mesh_.elements[e]) {
    dofs.push_back(2 * node);
    dofs.push_back(2 * node + 1);
  }
  if (corner_.empty()) return dofs;
  for (int a = 0; a < 4; ++a) {
    for (int c = 0; c < 4; ++c) dofs.push_back(gradient_dof(mesh_.elements[e][a], c));
  }
  return dofs;
}

double Formulation::residual_length(int i) const {
  return i < 2 * static_cast<int>(mesh_.nodes.size()) ? 1 : mean_size_;
}

int Formulation::gradient_dof(int node, int c) const {
  if (corner_.empty() || corner_[node] < 0) return -1;
  return 2 * static_cast<int>(mesh_.nodes.size()) + 4 * corner_[node] + c;
}

Formulation::GradientMatrix Formulation::in_plane(std::size_t point) const {
  const Gradient8& dN = shapes_[point].dN8;
  GradientMatrix B = GradientMatrix::Zero();
  for (int a = 0; a < 8; ++a) {
    for (int i = 0; i < 2; ++i) {
      for (int J = 0; J < 2; ++J) B(pair(i, J), 2 * a + i) = dN(a, J);
    }
  }
  return B;
}

SweptVolume Formulation::swept_volume(const Point2& position, const Point2& tangent) const {
  const double cross = position.x() * tangent.y() - position.y() * tangent.x();
  return {-0.5 * cross, -0.5 * outward_normal(tangent), 0.5 * outward_normal(position)};
}

std::vector<Tensor2> Formulation::deformation(const Eigen::VectorXd& x) const {
  std::vector<Tensor2> F(points(), Tensor2::Identity());
  Eigen::Matrix<double, 2, 8> u;
  for (std::size_t p = 0; p < points(); ++p) {
    const auto& nodes = mesh_.elements[p / kPointsPerElement];
    for (int a = 0; a < 8; ++a) u.col(a) = x.segment<2>(2 * nodes[a]);
    const GradientMatrix B = this->B(p);
    for (const int row : rows_) {
      const Eigen::Map<const Eigen::Matrix<double, 2, 8>> of_nodes(B.row(row).data());
      const Eigen::Matrix<double, 1, 8> terms = of_nodes.cwiseProduct(u).colwise().sum();
      F[p](row / 3, row % 3) += terms.sum();
    }
  }
  return F;
}

Eigen::Matrix<double, 16, 1> Formulation::material_force(int e, std::span<const Tensor2> F,
                                                         std::span<const Tensor2> stress) const {
  Eigen::Matrix<double, 16, 1> f = Eigen::Matrix<double, 16, 1>::Zero();
  for (int q = 0; q < kPointsPerElement; ++q) {
    const std::size_t p = kPointsPerElement * e + q;
    const Eigen::Matrix<double, 9, 1> P = first_piola(stress[p], F[p]).reshaped<Eigen::RowMajor>();
    const GradientMatrix weighted = shapes_[p].weight * B(p);
    f += weighted.transpose() * P;
  }
  return f;
}

Eigen::Matrix<double, 16, 16> Formulation::material_matrix(int e, std::span<const Tensor4> dPdF) const {
  Eigen::Matrix<double, 16, 16> K = Eigen::Matrix<double, 16, 16>::Zero();
  for (int q = 0; q < kPointsPerElement; ++q) {
    const std::size_t p = kPointsPerElement * e + q;
    const Eigen::Matrix<double, Eigen::Dynamic, 16, Eigen::RowMajor, 9, 16> B = this->B(p)(rows_, Eigen::all);
    const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, 9, 9> A = dPdF[p](rows_, rows_);
    K.noalias() += shapes_[p].weight * B.transpose() * (A * B);
  }
  return K;
}

Eigen::VectorXd Formulation::force(int e, const Configuration& at, std::span<const Tensor2> stress) const {
  return material_force(e, at.F, stress);
}

Eigen::MatrixXd Formulation::matrix(int e, const Linearisation& at) const { return material_matrix(e, at.dPdF); }

Formulation::Vector32 Formulation::local_increment(int e, const Eigen::VectorXd& x) const {
  Vector32 local;
  const std::vector<int> index = dofs(e);
  for (int i = 0; i < 32; ++i) local[i] = x[index[i]] - start_[index[i]];
  return local;
}

Eigen::VectorXd Formulation::constraint_force(int e, const Eigen::VectorXd& x, double penalty) const {
  if (constraints_.empty()) return {};
  const auto& [gap, volume] = constraints_[e];
  const Eigen::Vector4d g = gap * local_increment(e, x);
  return volume * penalty * gap.transpose() * g;
}

Eigen::VectorXd Formulation::updated_multipliers(const Eigen::VectorXd& multipliers, const Eigen::VectorXd& x,
                                                 double penalty) const {
  Eigen::VectorXd updated = multipliers;
  for (int e = 0; e < static_cast<int>(constraints_.size()); ++e) {
    const Eigen::Vector4d g = constraints_[e].gap * local_increment(e, x);
    updated.segment<4>(4 * e) += penalty * g;
  }
  return updated;
}

double Formulation::constraint_gap(const Eigen::VectorXd& x) const {
  double gaps = 0, increments = 0;
  for (std::size_t e = 0; e < constraints_.size(); ++e) {
    const auto& gap = constraints_[e].gap;
    const Vector32 local = local_increment(static_cast<int>(e), x);
    gaps = std::max(gaps, (gap * local).norm());
    increments = std::max(increments, (gap.rightCols<16>() * local.tail<16>()).norm());
  }
  return increments > 0 ? gaps / increments : gaps;
}

void Formulation::commit(Eigen::VectorXd& x) { start_ = x; }

void Formulation::save(NamedArrays& arrays) const {
  arrays.emplace_back("formulation.start", std::vector<double>(start_.begin(), start_.end()));
}

void Formulation::load(const NamedArrays& arrays) {
  const auto& start = find_array(arrays, "formulation.start");
  start_ = Eigen::Map<const Eigen::VectorXd>(start.data(), static_cast<Eigen::Index>(start.size()));
}

}  // namespace femxdem
