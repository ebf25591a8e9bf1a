#include "mesh_gaps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <unordered_map>
#include <vector>

#include "errors.hpp"

namespace femxdem {
namespace {

constexpr double kSamePlace = 1e-6;  // of the shortest side

double shortest_side(const Mesh& mesh) {
  double shortest = std::numeric_limits<double>::infinity();
  for (const auto& e : mesh.elements)
    for (int k = 0; k < 4; ++k) shortest = std::min(shortest, (mesh.nodes[e[k]] - mesh.nodes[e[(k + 1) % 4]]).norm());
  return shortest;
}

/// Pairs of nodes closer than `distance`, found in squares of that size.
std::vector<std::pair<int, int>> close_pairs(const Mesh& mesh, double distance) {
  using Square = std::pair<std::int64_t, std::int64_t>;
  const auto square = [&](const Point2& x) {
    return Square{std::llround(std::floor(x.x() / distance)), std::llround(std::floor(x.y() / distance))};
  };
  std::map<Square, std::vector<int>> squares;
  std::vector<std::pair<int, int>> pairs;
  for (int n = 0; n < static_cast<int>(mesh.nodes.size()); ++n) {
    const Square home = square(mesh.nodes[n]);
    for (int i = -1; i <= 1; ++i) {
      for (int j = -1; j <= 1; ++j) {
        const auto near = squares.find({home.first + i, home.second + j});
        if (near == squares.end()) continue;
        for (const int other : near->second)
          if ((mesh.nodes[n] - mesh.nodes[other]).norm() < distance) pairs.push_back({other, n});
      }
    }
    squares[home].push_back(n);
  }
  return pairs;
}

void refuse_hanging_nodes(const Mesh& mesh, const std::string& file) {
  std::vector<bool> corner(mesh.nodes.size(), false);
  std::vector<int> uses(mesh.nodes.size(), 0);
  for (const auto& e : mesh.elements)
    for (int k = 0; k < 4; ++k) corner[e[k]] = true;
  for (const auto& e : mesh.elements) {
    for (int k = 4; k < 8; ++k) {
      const Point2& x = mesh.nodes[e[k]];
      if (corner[e[k]])
        throw UserError(fmt::format(
            "{}: the node at ({:.4g}, {:.4g}) is a corner of one element and in the middle of another's side; make "
            "the two meshes meet side by side",
            file, x.x(), x.y()));
      if (++uses[e[k]] > 2)
        throw UserError(
            fmt::format("{}: the side at ({:.4g}, {:.4g}) belongs to three elements; remove surfaces that overlap",
                        file, x.x(), x.y()));
    }
  }
}

}  // namespace

void refuse_gaps(const Mesh& mesh, const std::string& file) {
  const auto pairs = close_pairs(mesh, kSamePlace * shortest_side(mesh));
  if (!pairs.empty()) {
    const Point2& x = mesh.nodes[pairs.front().first];
    throw UserError(fmt::format(
        "{}: {} pairs of nodes lie at one place without being one, the first at ({:.4g}, {:.4g}): parts that touch are "
        "not "
        "joined; in Gmsh write `Coherence;` (and leave Geometry.AutoCoherence at 1), or `Coherence Mesh;` for a mesh",
        file, pairs.size(), x.x(), x.y()));
  }
  refuse_hanging_nodes(mesh, file);
}

}  // namespace femxdem
