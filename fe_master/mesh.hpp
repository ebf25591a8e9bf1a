#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "tensor.hpp"

namespace femxdem {

using Point2 = Eigen::Vector2d;

/// Side of an element on a named edge of the mesh.
struct Side {
  int element = 0;
  std::array<int, 3> nodes{};  ///< first corner, mid-side, second corner, with the material on the left
};

/// Mesh of 8-node quadrilaterals in the reference configuration.
///
///     3 --6-- 2      corners 0 to 3 counter-clockwise, then the mid-side nodes;
///     7       5      side k runs from corner k over node 4 + k to corner (k + 1) % 4.
///     0 --4-- 1
struct Mesh {
  std::vector<Point2> nodes;                        ///< reference coordinates [m]
  std::vector<std::array<int, 8>> elements;
  std::map<std::string, std::vector<Side>> edges;   ///< named edges, sides in order along the edge
  std::map<std::string, std::vector<int>> regions;  ///< named sets of elements
};

}  // namespace femxdem
