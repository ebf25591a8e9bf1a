#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "compact_block.hpp"

namespace femxdem {

/// What the integrator needs beside the spheres.
struct CompactMotion {
  double dt = 0, damping = 0;
  Row3 previous_L{};             ///< P: of the mean field that the velocities hold [1/s]
  Row3 change{};                 ///< L - P
  std::array<double, 3> spin{};  ///< of L - P [rad/s]
  Row3 since_list{};             ///< deformation gradient of the cell since the list of pairs was made
};

/// What the contacts need beside themselves and the spheres.
struct CompactCellMotion {
  double dt = 0;
  Row3 H{};  ///< [m]
  Row3 G{};  ///< L times the previous H: velocities of the cell vectors [m/s]
};

/// The step's loops, as one processor level has them. Every level gives equal bits.
struct CompactLoops {
  /// Moves the spheres by one step and clears their forces. The largest |x - F x_list|^2 [m^2].
  double (*integrate)(const CompactArrays&, const CompactMotion&);
  /// Forces of all contacts, on the spheres too. Fills `lost` (room for all) with the numbers of those that have come
  /// to their end, rising; returns how many.
  std::size_t (*cohesive)(const CompactArrays&, const CompactCellMotion&, std::uint32_t* lost);
  std::size_t (*friction)(const CompactArrays&, const CompactCellMotion&, std::uint32_t* lost);
  /// The law of Nguyen et al. (2017) to the letter. While the overlap delta lasts, f_n = f_el - f_c and |f_t| <= mu
  /// f_el, f_el = kn delta: no plateau in tension, sliding leaves f_n alone, the contact ends with the overlap. With
  /// dashpots f_el = max(0, kn delta + c d(delta)/dt), c = 2 ratio sqrt(kn m), m = m_i m_j / (m_i + m_j).
  std::size_t (*paper)(const CompactArrays&, const CompactCellMotion&, std::uint32_t* lost);
};

const CompactLoops& compact_loops();  ///< of kernel_in_use()

}  // namespace femxdem
