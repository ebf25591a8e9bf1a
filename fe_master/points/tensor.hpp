#pragma once

#include <Eigen/Dense>

namespace femxdem {

/// Second-order tensor in three dimensions, T(i, j).
using Tensor2 = Eigen::Matrix3d;
/// Fourth-order tensor C_ijkl as a 9 x 9 matrix: row 3 i + j, column 3 k + l.
using Tensor4 = Eigen::Matrix<double, 9, 9, Eigen::RowMajor>;

/// Row (or column) of the pair (i, j) in a Tensor4.
constexpr int pair(int i, int j) { return 3 * i + j; }

/// F = R U: rotation and right stretch.
struct PolarDecomposition {
  Tensor2 R;
  Tensor2 U;
};

/// Polar decomposition of F with det F > 0 (singular values; exact to round-off for any stretch).
PolarDecomposition polar_decomposition(const Tensor2& F);

/// Hencky strain ln U of F = R U (ln U = 1/2 ln F^T F) [-].
Tensor2 logarithmic_strain(const Tensor2& F);
/// First Piola-Kirchhoff stress P = J sigma F^-T [Pa].
Tensor2 first_piola(const Tensor2& stress, const Tensor2& F);

/// T_ij rotated: R T R^T.
Tensor2 rotate(const Tensor2& T, const Tensor2& R);
/// C_ijkl rotated: R_ia R_jb R_kc R_ld C_abcd.
Tensor4 rotate(const Tensor4& C, const Tensor2& R);
/// Isotropic elasticity: lambda d_ij d_kl + G (d_ik d_jl + d_il d_jk) [Pa].
Tensor4 isotropic_stiffness(double lambda, double G);

}  // namespace femxdem
