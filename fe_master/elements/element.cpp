#include "element.hpp"

#include <fmt/format.h>

#include <cmath>

#include "errors.hpp"

namespace femxdem {

Element::Element(const Mesh& mesh) : mesh_(mesh) {
  committed_ = Eigen::VectorXd::Zero(2 * static_cast<Eigen::Index>(mesh.nodes.size()));
  shapes_.reserve(mesh.elements.size() * kPointsPerElement);
  for (std::size_t e = 0; e < mesh.elements.size(); ++e) {
    Eigen::Matrix<double, 8, 2> X;
    for (int a = 0; a < 8; ++a) X.row(a) = mesh.nodes[mesh.elements[e][a]].transpose();
    for (const QuadraturePoint& g : gauss_2x2()) {
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
      shapes_.push_back({g.weight * det, dN8 * inverse, shape_q4(g.xi, g.eta), shape_gradient_q4(g.xi, g.eta) * inverse,
                         X.transpose() * shape_q8(g.xi, g.eta)});
    }
  }
}

std::vector<int> Element::dofs(int e) const {
  std::vector<int> dofs;
  for (const int node : mesh_.elements[e]) {
    dofs.push_back(2 * node);
    dofs.push_back(2 * node + 1);
  }
  return dofs;
}

double Element::residual_length(int /*i*/) const { return 1; }

int Element::gradient_dof(int /*node*/, int /*c*/) const { return -1; }

Eigen::Matrix<double, 8, 2> Element::displacements(int e, const Eigen::VectorXd& x) const {
  Eigen::Matrix<double, 8, 2> u;
  for (int a = 0; a < 8; ++a) u.row(a) = x.segment<2>(2 * mesh_.elements[e][a]).transpose();
  return u;
}

std::vector<Tensor2> Element::deformation(const Eigen::VectorXd& x) const {
  std::vector<Tensor2> F(points(), Tensor2::Identity());
  for (std::size_t p = 0; p < points(); ++p) {
    const auto u = displacements(static_cast<int>(p / kPointsPerElement), x);
    F[p].topLeftCorner<2, 2>() += u.transpose() * shapes_[p].dN8;
  }
  return F;
}

Eigen::VectorXd Element::force(int e, const Eigen::VectorXd& /*x*/, std::span<const Tensor2> F,
                               std::span<const Tensor2> stress) const {
  Eigen::Matrix<double, 8, 2> f = Eigen::Matrix<double, 8, 2>::Zero();
  for (int q = 0; q < kPointsPerElement; ++q) {
    const PointShapes& s = shapes_[kPointsPerElement * e + q];
    f += s.weight * s.dN8 * first_piola(stress[q], F[q]).topLeftCorner<2, 2>().transpose();
  }
  return Eigen::Map<const Eigen::VectorXd>(Eigen::Matrix<double, 8, 2, Eigen::RowMajor>(f).data(), 16);
}

Eigen::MatrixXd Element::matrix(int e, const Eigen::VectorXd& /*x*/, std::span<const Tensor2> /*F*/,
                                std::span<const Tensor4> dPdF, bool /*exact*/) const {
  Eigen::Matrix<double, 16, 16> K = Eigen::Matrix<double, 16, 16>::Zero();
  for (int q = 0; q < kPointsPerElement; ++q) {
    const PointShapes& s = shapes_[kPointsPerElement * e + q];
    Eigen::Matrix<double, 4, 16> B = Eigen::Matrix<double, 4, 16>::Zero();  // dF_iJ (row 2 i + J) from the unknowns
    for (int a = 0; a < 8; ++a) {
      B(0, 2 * a) = B(2, 2 * a + 1) = s.dN8(a, 0);
      B(1, 2 * a) = B(3, 2 * a + 1) = s.dN8(a, 1);
    }
    Eigen::Matrix4d A;
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < 4; ++k) A(i, k) = dPdF[q](pair(i / 2, i % 2), pair(k / 2, k % 2));
    }
    K.noalias() += s.weight * B.transpose() * (A * B);
  }
  return K;
}

void Element::begin_step(Eigen::VectorXd& x) { x = committed_; }

void Element::extrapolate(Eigen::VectorXd& x, double factor) {
  if (last_increment_.size() == x.size()) x += factor * last_increment_;
}

void Element::commit(const Eigen::VectorXd& x) {
  last_increment_ = x - committed_;
  committed_ = x;
}

void Element::save(NamedArrays& arrays) const {
  arrays.emplace_back("element.last_increment",
                      std::vector<double>(last_increment_.data(), last_increment_.data() + last_increment_.size()));
  arrays.emplace_back("element.committed",
                      std::vector<double>(committed_.data(), committed_.data() + committed_.size()));
}

void Element::load(const NamedArrays& arrays) {
  const auto& last = find_array(arrays, "element.last_increment");
  last_increment_ = Eigen::Map<const Eigen::VectorXd>(last.data(), static_cast<Eigen::Index>(last.size()));
  const auto& committed = find_array(arrays, "element.committed");
  committed_ = Eigen::Map<const Eigen::VectorXd>(committed.data(), static_cast<Eigen::Index>(committed.size()));
}

}  // namespace femxdem
