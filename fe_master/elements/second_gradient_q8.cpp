#include "second_gradient_q8.hpp"

namespace femxdem {
namespace {

Eigen::Matrix2d in_plane(const Tensor2& F) { return F.topLeftCorner<2, 2>(); }

template <typename Vectors>
std::vector<double> flatten(const Vectors& vectors) {
  std::vector<double> values;
  for (const auto& v : vectors) values.insert(values.end(), v.data(), v.data() + v.size());
  return values;
}

template <typename Vectors>
void unflatten(const std::vector<double>& values, Vectors& vectors) {
  std::size_t i = 0;
  for (auto& v : vectors) {
    for (Eigen::Index k = 0; k < v.size(); ++k) v.data()[k] = values.at(i++);
  }
}

}  // namespace

SecondGradientQ8::SecondGradientQ8(const Mesh& mesh, const DoubleStiffness& law)
    : Formulation(mesh, kPlaneStrain, MicroGradient::at_corners),
      law_(law),
      F_n_(points(), Eigen::Matrix2d::Identity()),
      sigma_(points(), DoubleStress::Zero()),
      micro_gradient_(Eigen::VectorXd::Zero(unknowns() - 2 * static_cast<int>(mesh.nodes.size()))) {
  update_constraints();
}

void SecondGradientQ8::update_constraints() {
  constraints_.resize(mesh_.elements.size());
  for (std::size_t e = 0; e < constraints_.size(); ++e) {
    auto& [gap, volume] = constraints_[e];
    gap.setZero();
    volume = 0;
    for (int q = 0; q < kPointsPerElement; ++q) {
      const std::size_t p = kPointsPerElement * e + q;
      const PointShapes& s = shapes_[p];
      const double weight = s.weight * F_n_[p].determinant();
      const Gradient8 dN = s.dN8 * F_n_[p].inverse();  // d N_a / dx_n
      for (int i = 0; i < 2; ++i) {
        for (int j = 0; j < 2; ++j) {
          for (int a = 0; a < 8; ++a) gap(2 * i + j, 2 * a + i) -= weight * dN(a, j);
          for (int a = 0; a < 4; ++a) gap(2 * i + j, 16 + 4 * a + 2 * i + j) += weight * s.N4[a];
        }
      }
      volume += weight;
    }
    gap /= volume;
  }
}

/// Double stress of a point at the unknowns x, from the gradient of v, dv_ij / dX_K.
DoublePiola SecondGradientQ8::double_piola(std::size_t point, const Eigen::VectorXd& x, const Tensor2& F,
                                           bool derivatives) const {
  DoubleStress H = DoubleStress::Zero();
  for (int a = 0; a < 4; ++a) {
    const Eigen::Vector4d v = x.segment<4>(gradient_dof(mesh_.elements[point / kPointsPerElement][a], 0));
    for (int c = 0; c < 4; ++c) {
      for (int K = 0; K < 2; ++K) H[2 * c + K] += v[c] * shapes_[point].dN4(a, K);
    }
  }
  return update_double_stress(law_, femxdem::in_plane(F), F_n_[point], H, sigma_[point], derivatives);
}

Eigen::VectorXd SecondGradientQ8::force(int e, const Configuration& at, std::span<const Tensor2> stress) const {
  Eigen::VectorXd f = Eigen::VectorXd::Zero(32);
  f.head<16>() = material_force(e, at.F, stress);
  for (int q = 0; q < kPointsPerElement; ++q) {
    const std::size_t p = kPointsPerElement * e + q;
    const PointShapes& s = shapes_[p];
    const DoublePiola d = double_piola(p, at.x, at.F[p], false);
    for (int a = 0; a < 4; ++a) {
      for (int c = 0; c < 4; ++c) {
        f[16 + 4 * a + c] += s.weight * (d.T[2 * c] * s.dN4(a, 0) + d.T[2 * c + 1] * s.dN4(a, 1));
      }
    }
  }
  const auto& [gap, volume] = constraints_[e];
  const Eigen::Vector4d lambda = at.multipliers.segment<4>(4 * e);
  f += volume * gap.transpose() * lambda;
  return f;
}

Eigen::MatrixXd SecondGradientQ8::matrix(int e, const Linearisation& at) const {
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(32, 32);
  K.topLeftCorner<16, 16>() = material_matrix(e, at.dPdF);
  for (int q = 0; q < kPointsPerElement; ++q) {
    const std::size_t p = kPointsPerElement * e + q;
    const PointShapes& s = shapes_[p];
    const DoublePiola d = double_piola(p, at.x, at.F[p], at.exact);
    Eigen::Matrix<double, 8, 16> H = Eigen::Matrix<double, 8, 16>::Zero();  // dv_ij,K from v
    for (int a = 0; a < 4; ++a) {
      for (int c = 0; c < 4; ++c) {
        H(2 * c, 4 * a + c) = s.dN4(a, 0);
        H(2 * c + 1, 4 * a + c) = s.dN4(a, 1);
      }
    }
    K.bottomRightCorner<16, 16>() += s.weight * H.transpose() * d.dT_dH * H;
    if (!at.exact) continue;
    const Eigen::Matrix<double, 4, 16> B = this->B(p)({pair(0, 0), pair(0, 1), pair(1, 0), pair(1, 1)}, Eigen::all);
    K.bottomLeftCorner<16, 16>() += s.weight * H.transpose() * d.dT_dF * B;
  }
  const auto& [gap, volume] = constraints_[e];
  K += at.penalty * volume * gap.transpose() * gap;
  return K;
}

void SecondGradientQ8::commit(Eigen::VectorXd& x) {
  const std::vector<Tensor2> F = deformation(x);
  for (std::size_t p = 0; p < points(); ++p) {
    sigma_[p] = double_piola(p, x, F[p], false).sigma;
    F_n_[p] = femxdem::in_plane(F[p]);
  }
  const Eigen::Index v = micro_gradient_.size();
  micro_gradient_ += x.tail(v);
  x.tail(v).setZero();
  Formulation::commit(x);
  update_constraints();
}

Eigen::Vector4d SecondGradientQ8::micro_gradient(int node) const {
  const int dof = gradient_dof(node, 0);
  if (dof < 0) return Eigen::Vector4d::Zero();
  return micro_gradient_.segment<4>(dof - 2 * static_cast<Eigen::Index>(mesh_.nodes.size()));
}

std::vector<Field> SecondGradientQ8::node_fields() const {
  Field v{"micro_gradient", 4, {}};
  for (int n = 0; n < static_cast<int>(mesh_.nodes.size()); ++n) {
    const Eigen::Vector4d value = micro_gradient(n);
    v.values.insert(v.values.end(), value.begin(), value.end());
  }
  return {v};
}

std::vector<Field> SecondGradientQ8::point_fields() const { return {{"double_stress", 8, flatten(sigma_)}}; }

void SecondGradientQ8::save(NamedArrays& arrays) const {
  Formulation::save(arrays);
  arrays.emplace_back("second_gradient.F", flatten(F_n_));
  arrays.emplace_back("second_gradient.double_stress", flatten(sigma_));
  arrays.emplace_back("second_gradient.micro_gradient",
                      std::vector<double>(micro_gradient_.begin(), micro_gradient_.end()));
}

void SecondGradientQ8::load(const NamedArrays& arrays) {
  Formulation::load(arrays);
  unflatten(find_array(arrays, "second_gradient.F"), F_n_);
  unflatten(find_array(arrays, "second_gradient.double_stress"), sigma_);
  const auto& v = find_array(arrays, "second_gradient.micro_gradient");
  micro_gradient_ = Eigen::Map<const Eigen::VectorXd>(v.data(), static_cast<Eigen::Index>(v.size()));
  update_constraints();
}

}  // namespace femxdem
