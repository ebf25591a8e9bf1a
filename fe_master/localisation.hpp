#pragma once

#include "tensor.hpp"

/// Monitors of material instability at a point, in the plane (x1, x2).
namespace femxdem {

/// Smallest determinant of the in-plane acoustic tensor A_ik = n_j C_ijkl n_l [Pa^2] over the directions of a band
/// (Rice, 1976): a shear band can form once it is not positive. `tangent` is d sigma / dh with the spin of the stress
/// included (Operator::tangent); at finite strain the geometric terms sigma_ij d_kl - sigma_il d_jk then cancel, since
/// n_j n_l of either is (sigma n)_i n_k. `inclination`, when given, receives the band's inclination from x1 [rad], in
/// [0, pi) by steps of half a degree; n = (-sin, cos) of it. Of two equal minima the smaller inclination.
double min_acoustic_determinant(const Tensor4& tangent, double* inclination = nullptr);

/// Second-order work per current volume [Pa], (d sigma + sigma tr h - sigma h^T) : h, of the step that has led to the
/// stress sigma by d sigma along the spatial gradient h (Hill, 1958; the increment of the nominal stress against h).
double second_order_work(const Tensor2& stress, const Tensor2& stress_increment, const Tensor2& gradient);

}  // namespace femxdem
