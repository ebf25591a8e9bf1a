#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

/// The springs of a periodic packing's contacts: stiffness and time step.
namespace femxdem {

/// Of the authors' code, on the stiffnesses of Eq. (2): VeStiffness::reduced.
inline constexpr double kReducedNormal = 0.93, kReducedTangent = 0.63;

struct Spring {
  std::int64_t i = 0, j = 0;  ///< grains
  Eigen::Vector3d normal;     ///< unit, from i to j
  double length = 0;          ///< of the branch vector [m]
  double kn = 0, kt = 0;      ///< [N/m]
};

/// The affine stiffness, Eq. (2) of Nguyen et al. (2017) with both tangents, symmetrised in both pairs; (3, 3, 3, 3),
/// row-major [Pa]: C_ijkl = (1/V) sum [(kn - kt) n_i n_k + kt delta_ik] l_j l_l.
std::array<double, 81> affine_stiffness(std::span<const Spring> springs, double volume);

/// What that stiffness loses when the grains move and spin into equilibrium: (1/V) F^T K^-1 F, (6, 6) [Pa] over the
/// strain components xx, yy, zz, xy, yz, zx (tensor, not engineering), K and F the network's stiffness and loads under
/// a unit strain. Throws std::invalid_argument for a grain that is not there, std::runtime_error if K is indefinite.
Eigen::MatrixXd released_stiffness(std::int64_t grains, std::span<const Spring> springs, double volume);

/// The affine stiffness without the released one, (3, 3, 3, 3) [Pa].
std::array<double, 81> relaxed_stiffness(std::int64_t grains, std::span<const Spring> springs, double volume);

struct NetworkGrain {
  double mass = 0, inertia = 0, radius = 0;  ///< [kg], [kg m^2], [m]
};
/// 2/omega_max [s] of the network by power iteration from `start`, (2, grains, 3): as yade_scripts/time_step.py.
double critical_time_step(std::span<const NetworkGrain> grains, std::span<const Spring> springs,
                          std::span<const double> start);

}  // namespace femxdem
