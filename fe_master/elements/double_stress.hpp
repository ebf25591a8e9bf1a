#pragma once

#include <Eigen/Dense>
#include <array>

#include "element_parameters.hpp"

namespace femxdem {

/// Components of a third-order tensor in the plane: T_ijk at 4 i + 2 j + k (111, 112, 121, 122, 211, 212, 221, 222).
using DoubleStress = Eigen::Matrix<double, 8, 1>;
using DoubleStiffness = Eigen::Matrix<double, 8, 8>;

/// Double-stress law with one parameter D [N], Sigma = law . grad v, order of DoubleStress. Isotropic; eigenvalues
/// D {2, 2, 1, 1, 0, 0, 0, 0} (Collin, Chambon, Charlier 2006; the case of Matsushima, Chambon, Caillerie 2002).
DoubleStiffness one_parameter_law(double D);

/// General isotropic law of Mindlin (1964) with a1 .. a5 [N]; one_parameter_law(D) is (D/2, 0, 0, D/2, -D/2).
DoubleStiffness mindlin_law(const std::array<double, 5>& a);

/// Pulled-back double stress T_ijK = J Sigma_ijk F^-1_Kk, at 4 i + 2 j + K [N/m, times the volume dV: power of v_ij,K],
/// with its derivatives.
struct DoublePiola {
  DoubleStress sigma;  ///< Sigma_ijk, current configuration [N]
  DoubleStress T;
  Eigen::Matrix<double, 8, 4> dT_dF;  ///< columns 2 i + J
  Eigen::Matrix<double, 8, 8> dT_dH;  ///< columns 4 i + 2 j + K
};

/// Objective update of the double stress over a step (Jaumann rate on three indices, rotations of Hughes and Winget
/// 1980, increment evaluated at mid-step and half-rotated: second order, exact for rigid rotations).
/// F, F_n: in-plane deformation gradients at the end and at the start of the step; H: d(Delta v_ij)/dX_K (8);
/// sigma_n: committed double stress. `derivatives`: exact ones (forward automatic differentiation); else dT_dF is zero
/// and dT_dH is the symmetric J F^-1 law F^-T.
DoublePiola update_double_stress(const DoubleStiffness& law, const Eigen::Matrix2d& F, const Eigen::Matrix2d& F_n,
                                 const DoubleStress& H, const DoubleStress& sigma_n, bool derivatives);

/// The law of the double stress of an [element] table.
DoubleStiffness make_double_stiffness(const ElementParameters& e);

}  // namespace femxdem
