#pragma once

#include <string>
#include <vector>

#include "given.hpp"

namespace femxdem {

enum class MeshType { rectangle, annulus, gmsh };
struct MeshParameters {
  MeshType type = MeshType::rectangle;
  double width = kNotGiven, height = kNotGiven;               ///< rectangle, lower left corner at the origin [m]
  int nx = 0, ny = 0;                                         ///< elements along width and height; 0: not given
  double inner_radius = kNotGiven, outer_radius = kNotGiven;  ///< annulus sector centred at the origin [m]
  double angle = 90.0;                                        ///< of the sector, from the x axis [deg]
  int nr = 0, nt = 0;                                         ///< elements along the radius and the angle; 0: not given
  std::string file;                                           ///< Gmsh mesh or geometry, absolute path
  double distortion = 0.0;  ///< largest random shift of interior corners / element size
  int seed = 1;             ///< of the distortion
};

/// A named set of elements: those whose centre lies in the box, or those listed.
struct Region {
  std::string name;
  std::vector<double> box;    ///< x0, y0, x1, y1 [m], or empty
  std::vector<int> elements;  ///< element numbers, or empty
};

}  // namespace femxdem
