#pragma once

#include <string>

namespace femxdem {

enum class Quantity {
  reaction_x,
  reaction_y,  ///< sum over the edge [N per thickness; axisymmetric N, of the full circumference]
  displacement_x,
  displacement_y,  ///< mean over the edge [m]
  length,          ///< of the deformed edge [m]
  pressure,        ///< follower pressure on the edge [Pa]
  stress_xx,
  stress_yy,
  stress_zz,
  stress_xy  ///< rr, zz, tt, rz of axisymmetric elements; volume mean over the region, or over the mesh [Pa]
};
/// A column of history.csv.
struct Monitor {
  std::string name;
  Quantity quantity = Quantity::reaction_y;
  std::string edge;    ///< of reactions, displacements, length, pressure
  std::string region;  ///< of stresses; empty: the whole mesh
};

}  // namespace femxdem
