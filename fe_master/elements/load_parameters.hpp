#pragma once

#include <array>
#include <string>
#include <vector>

#include "given.hpp"

namespace femxdem {

enum class LoadKind { displacement, velocity, traction, pressure, gradient };
/// x, y of a vector; xx, xy, yx, yy are "11", "12", "21", "22" of the micro gradient v_ij.
enum class Component { none, x, y, xx, xy, yx, yy };
struct Load {
  std::string edge;
  std::vector<double> point;  ///< x, y [m]: acts on the node nearest to it instead of an edge (a pin); or empty
  LoadKind kind = LoadKind::displacement;
  Component component = Component::none;
  double value = kNotGiven;                  ///< [m], [m/s], [Pa per initial area], [Pa, compression positive], [-]
  std::vector<std::array<double, 2>> table;  ///< (time, factor) pairs, piecewise linear, or empty: the default factor
};
/// Load factor at time t: from the table (constant beyond its ends), else t / end_time for displacement and gradient,
/// t for velocity, 1 for traction and pressure. The prescribed quantity is value * factor.
double load_factor(const Load& load, double time, double end_time);

struct BodyForce {
  double x = 0.0, y = 0.0;  ///< force per current volume [N/m^3]
};

}  // namespace femxdem
