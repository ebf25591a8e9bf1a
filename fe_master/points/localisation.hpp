#pragma once

#include "tensor.hpp"

namespace femxdem {

/// In-plane acoustic tensor A_ik = n_j C_ijkl n_l [Pa] of the direction n = (n[0], n[1]).
Eigen::Matrix2d acoustic_tensor(const Tensor4& C, const Eigen::Vector2d& n);

/// Smallest determinant of the in-plane acoustic tensor A_ik = n_j C_ijkl n_l [Pa^2] over the directions of a band
/// (Rice, 1976): a shear band can form once it is not positive. `tangent` is d sigma / dh with the spin of the stress
/// included (Operator::tangent); at finite strain the geometric terms sigma_ij d_kl - sigma_il d_jk then cancel, since
/// n_j n_l of either is (sigma n)_i n_k. dP/dF in its place gives the nominal one, of the same sign. `inclination`,
/// when given, receives the band's inclination from x1 [rad], in [0, pi) by steps of half a degree; n = (-sin, cos) of
/// it. Of two equal minima the smaller inclination.
double min_acoustic_determinant(const Tensor4& tangent, double* inclination = nullptr);

}  // namespace femxdem
