#include "second_gradient_q8.hpp"

#include <cmath>

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

SecondGradientQ8::SecondGradientQ8(const Mesh& mesh, const DoubleStiffness& law, double penalty)
    : Element(mesh),
      law_(law),
      penalty_(penalty),
      corner_(mesh.nodes.size(), -1),
      F_n_(points(), Eigen::Matrix2d::Identity()),
      sigma_(points(), DoubleStress::Zero()),
      lambda_n_(mesh.elements.size(), Eigen::Vector4d::Zero()),
      lambda_(lambda_n_),
      lambda_increment_(lambda_n_),
      gap_(mesh.elements.size()),
      volume_n_(mesh.elements.size()) {
  int corners = 0;
  for (const auto& nodes : mesh.elements) {
    for (int a = 0; a < 4; ++a) {
      if (corner_[nodes[a]] < 0) corner_[nodes[a]] = corners++;
    }
  }
  unknowns_ = 2 * static_cast<int>(mesh.nodes.size()) + 4 * corners;
  micro_gradient_ = Eigen::VectorXd::Zero(4 * corners);
  committed_ = Eigen::VectorXd::Zero(unknowns_);
  double area = 0;
  for (const PointShapes& s : shapes_) area += s.weight;
  mean_size_ = std::sqrt(area / static_cast<double>(mesh.elements.size()));
  update_gap_operators();
}

std::vector<int> SecondGradientQ8::dofs(int e) const {
  std::vector<int> dofs = Element::dofs(e);
  for (int a = 0; a < 4; ++a) {
    for (int c = 0; c < 4; ++c) dofs.push_back(gradient_dof(mesh_.elements[e][a], c));
  }
  return dofs;
}

double SecondGradientQ8::residual_length(int i) const {
  return i < 2 * static_cast<int>(mesh_.nodes.size()) ? 1 : mean_size_;
}

int SecondGradientQ8::gradient_dof(int node, int c) const {
  return corner_[node] < 0 ? -1 : 2 * static_cast<int>(mesh_.nodes.size()) + 4 * corner_[node] + c;
}

SecondGradientQ8::Vector32 SecondGradientQ8::local_increment(int e, const Eigen::VectorXd& x) const {
  Vector32 local;
  const std::vector<int> index = dofs(e);
  for (int i = 0; i < 32; ++i) local[i] = x[index[i]] - committed_[index[i]];
  return local;
}

DoubleStress SecondGradientQ8::gradient_of_v(int e, int q, const Eigen::VectorXd& x) const {
  const PointShapes& s = shapes_[kPointsPerElement * e + q];
  DoubleStress H = DoubleStress::Zero();
  for (int a = 0; a < 4; ++a) {
    const Eigen::Vector4d v = x.segment<4>(gradient_dof(mesh_.elements[e][a], 0));
    for (int c = 0; c < 4; ++c) {
      for (int K = 0; K < 2; ++K) H[2 * c + K] += v[c] * s.dN4(a, K);
    }
  }
  return H;
}

void SecondGradientQ8::update_gap_operators() {
  for (std::size_t e = 0; e < gap_.size(); ++e) {
    gap_[e].setZero();
    volume_n_[e] = 0;
    for (int q = 0; q < kPointsPerElement; ++q) {
      const std::size_t p = kPointsPerElement * e + q;
      const PointShapes& s = shapes_[p];
      const double weight = s.weight * F_n_[p].determinant();
      const Gradient8 dN = s.dN8 * F_n_[p].inverse();  // d N_a / dx_n
      for (int i = 0; i < 2; ++i) {
        for (int j = 0; j < 2; ++j) {
          for (int a = 0; a < 8; ++a) gap_[e](2 * i + j, 2 * a + i) -= weight * dN(a, j);
          for (int a = 0; a < 4; ++a) gap_[e](2 * i + j, 16 + 4 * a + 2 * i + j) += weight * s.N4[a];
        }
      }
      volume_n_[e] += weight;
    }
    gap_[e] /= volume_n_[e];
  }
}

Eigen::VectorXd SecondGradientQ8::force(int e, const Eigen::VectorXd& x, std::span<const Tensor2> F,
                                        std::span<const Tensor2> stress) const {
  Eigen::VectorXd f = Eigen::VectorXd::Zero(32);
  f.head<16>() = Element::force(e, x, F, stress);
  for (int q = 0; q < kPointsPerElement; ++q) {
    const std::size_t p = kPointsPerElement * e + q;
    const PointShapes& s = shapes_[p];
    const auto d = update_double_stress(law_, in_plane(F[q]), F_n_[p], gradient_of_v(e, q, x), sigma_[p], false);
    for (int a = 0; a < 4; ++a) {
      for (int c = 0; c < 4; ++c) {
        f[16 + 4 * a + c] += s.weight * (d.T[2 * c] * s.dN4(a, 0) + d.T[2 * c + 1] * s.dN4(a, 1));
      }
    }
  }
  f += volume_n_[e] * gap_[e].transpose() * lambda_[e];
  return f;
}

Eigen::VectorXd SecondGradientQ8::constraint_force(int e, const Eigen::VectorXd& x) const {
  return volume_n_[e] * penalty_ * gap_[e].transpose() * gap(e, x);
}

Eigen::MatrixXd SecondGradientQ8::matrix(int e, const Eigen::VectorXd& x, std::span<const Tensor2> F,
                                         std::span<const Tensor4> dPdF, bool exact) const {
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(32, 32);
  K.topLeftCorner<16, 16>() = Element::matrix(e, x, F, dPdF, exact);
  for (int q = 0; q < kPointsPerElement; ++q) {
    const std::size_t p = kPointsPerElement * e + q;
    const PointShapes& s = shapes_[p];
    const auto d = update_double_stress(law_, in_plane(F[q]), F_n_[p], gradient_of_v(e, q, x), sigma_[p], exact);
    Eigen::Matrix<double, 8, 16> H = Eigen::Matrix<double, 8, 16>::Zero();  // dv_ij,K from v
    for (int a = 0; a < 4; ++a) {
      for (int c = 0; c < 4; ++c) {
        H(2 * c, 4 * a + c) = s.dN4(a, 0);
        H(2 * c + 1, 4 * a + c) = s.dN4(a, 1);
      }
    }
    K.bottomRightCorner<16, 16>() += s.weight * H.transpose() * d.dT_dH * H;
    if (!exact) continue;
    Eigen::Matrix<double, 4, 16> B = Eigen::Matrix<double, 4, 16>::Zero();  // dF_iJ from u
    for (int a = 0; a < 8; ++a) {
      B(0, 2 * a) = B(2, 2 * a + 1) = s.dN8(a, 0);
      B(1, 2 * a) = B(3, 2 * a + 1) = s.dN8(a, 1);
    }
    K.bottomLeftCorner<16, 16>() += s.weight * H.transpose() * d.dT_dF * B;
  }
  K += penalty_ * volume_n_[e] * gap_[e].transpose() * gap_[e];
  return K;
}

void SecondGradientQ8::begin_step(Eigen::VectorXd& x) {
  x = committed_;
  lambda_ = lambda_n_;
}

Eigen::VectorXd SecondGradientQ8::multipliers() const {
  Eigen::VectorXd values(4 * static_cast<Eigen::Index>(lambda_.size()));
  for (std::size_t e = 0; e < lambda_.size(); ++e) values.segment<4>(4 * static_cast<Eigen::Index>(e)) = lambda_[e];
  return values;
}

void SecondGradientQ8::set_multipliers(const Eigen::VectorXd& values) {
  for (std::size_t e = 0; e < lambda_.size(); ++e) lambda_[e] = values.segment<4>(4 * static_cast<Eigen::Index>(e));
}

void SecondGradientQ8::update_multipliers(const Eigen::VectorXd& x) {
  for (std::size_t e = 0; e < lambda_.size(); ++e) lambda_[e] += penalty_ * gap(static_cast<int>(e), x);
}

void SecondGradientQ8::extrapolate(Eigen::VectorXd& x, double factor) {
  Element::extrapolate(x, factor);
  for (std::size_t e = 0; e < lambda_.size(); ++e) lambda_[e] += factor * lambda_increment_[e];
}

void SecondGradientQ8::commit(const Eigen::VectorXd& x) {
  const std::vector<Tensor2> F = deformation(x);
  for (std::size_t p = 0; p < points(); ++p) {
    const int e = static_cast<int>(p / kPointsPerElement);
    const DoubleStress H = gradient_of_v(e, static_cast<int>(p % kPointsPerElement), x);
    sigma_[p] = update_double_stress(law_, in_plane(F[p]), F_n_[p], H, sigma_[p], false).sigma;
    F_n_[p] = in_plane(F[p]);
  }
  for (std::size_t e = 0; e < lambda_.size(); ++e) lambda_increment_[e] = lambda_[e] - lambda_n_[e];
  lambda_n_ = lambda_;
  Element::commit(x);
  const Eigen::Index v = micro_gradient_.size();
  micro_gradient_ += x.tail(v);
  committed_.tail(v).setZero();
  update_gap_operators();
}

double SecondGradientQ8::constraint_gap(const Eigen::VectorXd& x) const {
  double gaps = 0, increments = 0;
  for (std::size_t e = 0; e < gap_.size(); ++e) {
    const Vector32 local = local_increment(static_cast<int>(e), x);
    gaps = std::max(gaps, (gap_[e] * local).norm());
    increments = std::max(increments, (gap_[e].rightCols<16>() * local.tail<16>()).norm());
  }
  return increments > 0 ? gaps / increments : gaps;
}

Eigen::Vector4d SecondGradientQ8::micro_gradient(int node) const {
  if (corner_[node] < 0) return Eigen::Vector4d::Zero();
  return micro_gradient_.segment<4>(4 * corner_[node]);
}

void SecondGradientQ8::save(NamedArrays& arrays) const {
  Element::save(arrays);
  arrays.emplace_back("second_gradient.F", flatten(F_n_));
  arrays.emplace_back("second_gradient.double_stress", flatten(sigma_));
  arrays.emplace_back("second_gradient.lambda", flatten(lambda_n_));
  arrays.emplace_back("second_gradient.lambda_increment", flatten(lambda_increment_));
  arrays.emplace_back("second_gradient.micro_gradient",
                      std::vector<double>(micro_gradient_.data(), micro_gradient_.data() + micro_gradient_.size()));
}

void SecondGradientQ8::load(const NamedArrays& arrays) {
  Element::load(arrays);
  unflatten(find_array(arrays, "second_gradient.F"), F_n_);
  unflatten(find_array(arrays, "second_gradient.double_stress"), sigma_);
  unflatten(find_array(arrays, "second_gradient.lambda"), lambda_n_);
  unflatten(find_array(arrays, "second_gradient.lambda_increment"), lambda_increment_);
  lambda_ = lambda_n_;
  const auto& v = find_array(arrays, "second_gradient.micro_gradient");
  micro_gradient_ = Eigen::Map<const Eigen::VectorXd>(v.data(), static_cast<Eigen::Index>(v.size()));
  update_gap_operators();
}

std::unique_ptr<Element> make_element(const ElementParameters& e, const Mesh& mesh) {
  if (e.type == ElementType::q8) return std::make_unique<Element>(mesh);
  return std::make_unique<SecondGradientQ8>(mesh, make_double_stiffness(e), 0.0);
}

}  // namespace femxdem
