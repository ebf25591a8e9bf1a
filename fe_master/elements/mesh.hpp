#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "mesh_parameters.hpp"
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
  std::vector<Point2> nodes;  ///< reference coordinates [m]
  std::vector<std::array<int, 8>> elements;
  std::map<std::string, std::vector<Side>> edges;   ///< named edges, sides in order along the edge
  std::map<std::string, std::vector<int>> regions;  ///< named sets of elements
};

/// Structured nx x ny mesh of [0, width] x [0, height] [m]; edges bottom, right, top, left.
Mesh rectangle_mesh(double width, double height, int nx, int ny);

/// Structured nr x nt mesh of the sector 0 <= theta <= angle [deg], inner_radius <= r <= outer_radius [m], mid-side
/// nodes on the circles; edges inner, outer, start (theta = 0), end (theta = angle). A full ring (360) has no start and
/// end.
Mesh annulus_mesh(double inner_radius, double outer_radius, double angle, int nr, int nt);

/// Mesh of 8-node quadrilaterals from a file that Gmsh reads (.msh, or .geo, which it then meshes); physical curves
/// give the edges, physical surfaces the regions. Throws UserError on another element, an unnamed or bad file.
Mesh gmsh_mesh(const std::string& file);

/// Shifts interior corners at random by at most `distortion` times the shortest side at that corner, and keeps sides
/// straight where they were; the same seed gives the same mesh.
void distort(Mesh& mesh, double distortion, int seed);

/// Mesh of a case: builder, distortion, regions; checked by check_mesh. Throws UserError.
Mesh make_mesh(const MeshParameters& m, const std::vector<Region>& regions);

/// Adds a region of a case: elements whose centre is in its box, or those listed. Throws UserError if there is none.
void add_region(Mesh& mesh, const Region& region);

/// Throws UserError naming the first element whose Jacobian is not positive at a corner or Gauss point.
void check_mesh(const Mesh& mesh);

/// Centre of an element: mean of its corners [m].
Point2 element_centre(const Mesh& mesh, int element);

}  // namespace femxdem
