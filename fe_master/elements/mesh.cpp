#include "mesh.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <set>

#include "errors.hpp"
#include "reference_element.hpp"

namespace femxdem {

namespace {

Side side_of(const Mesh& mesh, int element, int k) {
  const auto& e = mesh.elements[element];
  return {element, {e[k], e[4 + k], e[(k + 1) % 4]}};
}

/// Nodes of a structured m x n mesh: grid positions (i, j) in [0, 2m] x [0, 2n] without the centres of elements.
/// With `closed`, the line j = 2n is the line j = 0.
class Grid {
 public:
  Grid(int m, int n, bool closed, const std::function<Point2(int, int)>& position)
      : lines_(closed ? 2 * n : 2 * n + 1) {
    numbers_.assign((2 * m + 1) * lines_, -1);
    for (int j = 0; j < lines_; ++j) {
      for (int i = 0; i <= 2 * m; ++i) {
        if (i % 2 == 1 && j % 2 == 1) continue;
        numbers_[i * lines_ + j] = static_cast<int>(nodes.size());
        nodes.push_back(position(i, j));
      }
    }
  }
  int number(int i, int j) const { return numbers_[i * lines_ + j % lines_]; }
  std::vector<Point2> nodes;

 private:
  int lines_;
  std::vector<int> numbers_;
};

/// Elements in rows of constant j; the map (i, j) -> position keeps the orientation.
Mesh structured_mesh(int m, int n, bool closed, const std::function<Point2(int, int)>& position) {
  const Grid grid(m, n, closed, position);
  Mesh mesh;
  mesh.nodes = grid.nodes;
  for (int b = 0; b < 2 * n; b += 2) {
    for (int a = 0; a < 2 * m; a += 2) {
      mesh.elements.push_back({grid.number(a, b), grid.number(a + 2, b), grid.number(a + 2, b + 2),
                               grid.number(a, b + 2), grid.number(a + 1, b), grid.number(a + 2, b + 1),
                               grid.number(a + 1, b + 2), grid.number(a, b + 1)});
    }
  }
  return mesh;
}

/// The four boundaries of a structured mesh, each in counter-clockwise order: j = 0, i = m, j = n, i = 0.
std::array<std::vector<Side>, 4> structured_boundary(const Mesh& mesh, int m, int n) {
  std::array<std::vector<Side>, 4> sides;
  for (int a = 0; a < m; ++a) sides[0].push_back(side_of(mesh, a, 0));
  for (int b = 0; b < n; ++b) sides[1].push_back(side_of(mesh, b * m + m - 1, 1));
  for (int a = m - 1; a >= 0; --a) sides[2].push_back(side_of(mesh, (n - 1) * m + a, 2));
  for (int b = n - 1; b >= 0; --b) sides[3].push_back(side_of(mesh, b * m, 3));
  return sides;
}

/// Corners on the boundary: ends of the sides that belong to one element only.
std::vector<bool> boundary_corners(const Mesh& mesh) {
  std::map<std::pair<int, int>, int> uses;
  for (const auto& e : mesh.elements) {
    for (int k = 0; k < 4; ++k) ++uses[std::minmax(e[k], e[(k + 1) % 4])];
  }
  std::vector<bool> boundary(mesh.nodes.size(), false);
  for (const auto& [ends, count] : uses) {
    if (count == 1) boundary[ends.first] = boundary[ends.second] = true;
  }
  return boundary;
}

/// Shortest side at each corner [m].
std::vector<double> shortest_sides(const Mesh& mesh) {
  std::vector<double> shortest(mesh.nodes.size(), std::numeric_limits<double>::infinity());
  for (const auto& e : mesh.elements) {
    for (int k = 0; k < 4; ++k) {
      const int a = e[k], b = e[(k + 1) % 4];
      const double length = (mesh.nodes[a] - mesh.nodes[b]).norm();
      shortest[a] = std::min(shortest[a], length);
      shortest[b] = std::min(shortest[b], length);
    }
  }
  return shortest;
}

double jacobian(const Mesh& mesh, int element, double xi, double eta) {
  const Gradient8 gradient = shape_gradient_q8(xi, eta);
  Eigen::Matrix2d J = Eigen::Matrix2d::Zero();
  for (int a = 0; a < 8; ++a) J += mesh.nodes[mesh.elements[element][a]] * gradient.row(a);
  return J.determinant();
}

std::vector<int> elements_of(const Region& region, const Mesh& mesh) {
  if (!region.elements.empty()) return region.elements;
  std::vector<int> found;
  for (int e = 0; e < static_cast<int>(mesh.elements.size()); ++e) {
    const Point2 c = element_centre(mesh, e);
    const auto& b = region.box;
    if (c.x() >= b[0] && c.y() >= b[1] && c.x() <= b[2] && c.y() <= b[3]) found.push_back(e);
  }
  return found;
}

}  // namespace

Mesh rectangle_mesh(double width, double height, int nx, int ny) {
  Mesh mesh = structured_mesh(nx, ny, false,
                              [&](int i, int j) { return Point2(width * i / (2.0 * nx), height * j / (2.0 * ny)); });
  const auto sides = structured_boundary(mesh, nx, ny);
  mesh.edges = {{"bottom", sides[0]}, {"right", sides[1]}, {"top", sides[2]}, {"left", sides[3]}};
  return mesh;
}

Mesh annulus_mesh(double inner_radius, double outer_radius, double angle, int nr, int nt) {
  const bool ring = angle == 360.0;
  Mesh mesh = structured_mesh(nr, nt, ring, [&](int i, int j) {
    const double r = inner_radius + (outer_radius - inner_radius) * i / (2.0 * nr);
    // The end of a quarter or half is set exactly on its axis.
    const double turns = angle * j / (2.0 * nt) / 90.0;
    const double theta = turns * std::numbers::pi / 2.0;
    const bool on_axis = turns == std::floor(turns);
    return on_axis ? Point2(r * std::round(std::cos(theta)), r * std::round(std::sin(theta)))
                   : Point2(r * std::cos(theta), r * std::sin(theta));
  });
  const auto sides = structured_boundary(mesh, nr, nt);
  mesh.edges = {{"outer", sides[1]}, {"inner", sides[3]}};
  if (!ring) mesh.edges.insert({{"start", sides[0]}, {"end", sides[2]}});
  return mesh;
}

void distort(Mesh& mesh, double distortion, int seed) {
  const std::vector<bool> fixed = boundary_corners(mesh);
  const std::vector<double> size = shortest_sides(mesh);
  std::mt19937 random(static_cast<unsigned>(seed));
  const auto draw = [&random] { return 2.0 * (random() / 4294967296.0) - 1.0; };
  std::vector<Point2> shift(mesh.nodes.size(), Point2::Zero());
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n) {
    if (!fixed[n] && std::isfinite(size[n])) {
      const double x = draw(), y = draw();
      shift[n] = distortion * size[n] * Point2(x, y) / std::numbers::sqrt2;
    }
  }
  for (const auto& e : mesh.elements) {
    for (int k = 0; k < 4; ++k) shift[e[4 + k]] = 0.5 * (shift[e[k]] + shift[e[(k + 1) % 4]]);
  }
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n) mesh.nodes[n] += shift[n];
}

void add_region(Mesh& mesh, const Region& region) {
  const std::vector<int> elements = elements_of(region, mesh);
  if (elements.empty())
    throw UserError(fmt::format(
        "region '{}' holds no element; enlarge its box (an element is inside when its centre is)", region.name));
  for (int e : elements) {
    if (e < 0 || e >= static_cast<int>(mesh.elements.size()))
      throw UserError(fmt::format("region '{}' names element {}, but the mesh has elements 0 to {}; correct its list",
                                  region.name, e, mesh.elements.size() - 1));
  }
  mesh.regions[region.name] = elements;
}

Mesh make_mesh(const MeshParameters& m, const std::vector<Region>& regions) {
  Mesh mesh = m.type == MeshType::rectangle ? rectangle_mesh(m.width, m.height, m.nx, m.ny)
              : m.type == MeshType::annulus ? annulus_mesh(m.inner_radius, m.outer_radius, m.angle, m.nr, m.nt)
                                            : gmsh_mesh(m.file);
  if (m.distortion > 0.0) distort(mesh, m.distortion, m.seed);
  check_mesh(mesh);
  for (const Region& region : regions) add_region(mesh, region);
  return mesh;
}

void check_mesh(const Mesh& mesh) {
  constexpr std::array<std::array<double, 2>, 4> corners = {{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}};
  for (int e = 0; e < static_cast<int>(mesh.elements.size()); ++e) {
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [xi, eta] : corners) least = std::min(least, jacobian(mesh, e, xi, eta));
    for (const auto& q : gauss_2x2()) least = std::min(least, jacobian(mesh, e, q.xi, q.eta));
    if (!(least > 0.0)) {
      const Point2 x = element_centre(mesh, e);
      throw UserError(
          fmt::format("element {} at ({:.4g}, {:.4g}) is folded: its Jacobian falls to {:.3g} m2; "
                      "straighten it (lower mesh.distortion, or a finer mesh at the curved edge)",
                      e, x.x(), x.y(), least));
    }
  }
}

Point2 element_centre(const Mesh& mesh, int element) {
  Point2 sum = Point2::Zero();
  for (int k = 0; k < 4; ++k) sum += mesh.nodes[mesh.elements[element][k]];
  return sum / 4.0;
}

}  // namespace femxdem
