#include "tensor.hpp"

#include <Eigen/SVD>
#include <cassert>

namespace femxdem {

PolarDecomposition polar_decomposition(const Tensor2& F) {
  assert(F.determinant() > 0);
  const Eigen::JacobiSVD<Tensor2> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Tensor2& V = svd.matrixV();
  const Tensor2 U = V * svd.singularValues().asDiagonal() * V.transpose();
  return {svd.matrixU() * V.transpose(), 0.5 * (U + U.transpose())};
}

Tensor2 logarithmic_strain(const Tensor2& F) {
  const Eigen::SelfAdjointEigenSolver<Tensor2> C(F.transpose() * F);
  const Eigen::Vector3d half_logarithms = 0.5 * C.eigenvalues().array().log();
  return C.eigenvectors() * half_logarithms.asDiagonal() * C.eigenvectors().transpose();
}

Tensor2 first_piola(const Tensor2& stress, const Tensor2& F) {
  return F.determinant() * stress * F.inverse().transpose();
}

Tensor2 rotate(const Tensor2& T, const Tensor2& R) { return R * T * R.transpose(); }

Tensor4 rotate(const Tensor4& C, const Tensor2& R) {
  Tensor4 Q;  // Q_ijab = R_ia R_jb
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) Q(pair(i, j), pair(a, b)) = R(i, a) * R(j, b);
  return Q * C * Q.transpose();
}

Tensor4 isotropic_stiffness(double lambda, double G) {
  Tensor4 C = Tensor4::Zero();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      C(pair(i, i), pair(j, j)) += lambda;
      C(pair(i, j), pair(i, j)) += G;
      C(pair(i, j), pair(j, i)) += G;
    }
  return C;
}

}  // namespace femxdem
