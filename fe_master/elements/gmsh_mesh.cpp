#include <fmt/core.h>
#include <gmsh.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <filesystem>
#include <set>

#include "errors.hpp"
#include "mesh.hpp"
#include "mesh_gaps.hpp"
#include "msh2_file.hpp"
#include "own_process.hpp"

namespace femxdem {

namespace {

constexpr int kLine3 = 8;  // Gmsh's element types
constexpr int kQuad8 = 16;
constexpr double kRoundOff = 1e-9;  // of the mesh's size: a z below it is 0

/// Gmsh's session; it has one per process.
struct GmshSession {
  GmshSession() {
    gmsh::initialize(0, nullptr, false);
    gmsh::option::setNumber("General.Terminal", 0);
    gmsh::option::setNumber("Mesh.ElementOrder", 2);
    gmsh::option::setNumber("Mesh.SecondOrderIncomplete", 1);
  }
  ~GmshSession() { gmsh::finalize(); }
  GmshSession(const GmshSession&) = delete;
  GmshSession& operator=(const GmshSession&) = delete;
};

struct ElementBlock {
  std::vector<std::size_t> tags, nodes;
};

/// Elements of one type on the entity (dim, tag), -1: all; another type is the user's mistake.
ElementBlock elements_of_type(int wanted, int dim, int tag, const std::string& file) {
  std::vector<int> types;
  std::vector<std::vector<std::size_t>> tags, nodes;
  gmsh::model::mesh::getElements(types, tags, nodes, dim, tag);
  ElementBlock block;
  for (std::size_t t = 0; t < types.size(); ++t) {
    if (types[t] != wanted) {
      std::string name;
      int dimension = 0, order = 0, count = 0, primary = 0;
      std::vector<double> coordinates;
      gmsh::model::mesh::getElementProperties(types[t], name, dimension, order, count, coordinates, primary);
      throw UserError(
          fmt::format("{}: {} elements of type '{}', but only 8-node quadrilaterals are known; in Gmsh: "
                      "Recombine Surface, Mesh.ElementOrder = 2, Mesh.SecondOrderIncomplete = 1",
                      file, tags[t].size(), name));
    }
    block.tags.insert(block.tags.end(), tags[t].begin(), tags[t].end());
    block.nodes.insert(block.nodes.end(), nodes[t].begin(), nodes[t].end());
  }
  return block;
}

/// Nodes that the elements use, in Gmsh's order; the map is from Gmsh's tag to our number.
std::map<std::size_t, int> read_nodes(const ElementBlock& quads, const std::string& file, Mesh& mesh) {
  std::vector<std::size_t> tags;
  std::vector<double> x, parametric;
  gmsh::model::mesh::getNodes(tags, x, parametric, -1, -1, false, false);
  std::map<std::size_t, Eigen::Vector3d> position;
  for (std::size_t n = 0; n < tags.size(); ++n) position[tags[n]] = {x[3 * n], x[3 * n + 1], x[3 * n + 2]};
  std::map<std::size_t, int> number;
  Eigen::AlignedBox3d box;
  for (std::size_t tag : quads.nodes) {
    number[tag] = 0;
    box.extend(position.at(tag));
  }
  const double round_off = kRoundOff * box.diagonal().head<2>().norm();
  for (auto& [tag, n] : number) {
    const Eigen::Vector3d& p = position.at(tag);
    if (!(std::abs(p.z()) <= round_off))
      throw UserError(
          fmt::format("{}: node {} lies at z = {:.3g}; draw the mesh in the plane z = 0", file, tag, p.z()));
    n = static_cast<int>(mesh.nodes.size());
    mesh.nodes.emplace_back(p.x(), p.y());
  }
  return number;
}

/// An element with its corners counter-clockwise, whatever side Gmsh looked from.
std::array<int, 8> oriented(const std::array<int, 8>& e, const Mesh& mesh) {
  const Point2 a = mesh.nodes[e[2]] - mesh.nodes[e[0]], b = mesh.nodes[e[3]] - mesh.nodes[e[1]];
  if (a.x() * b.y() - a.y() * b.x() >= 0.0) return e;
  return {e[0], e[3], e[2], e[1], e[7], e[6], e[5], e[4]};
}

/// Sides in order along the edge, one connected chain after another.
std::vector<Side> in_order(std::vector<Side> sides) {
  std::vector<Side> ordered;
  while (!sides.empty()) {
    std::deque<Side> chain{sides.front()};
    sides.erase(sides.begin());
    for (bool grown = true; grown;) {
      const auto next = std::find_if(sides.begin(), sides.end(), [&](const Side& s) {
        return s.nodes[0] == chain.back().nodes[2] || s.nodes[2] == chain.front().nodes[0];
      });
      grown = next != sides.end();
      if (!grown) break;
      next->nodes[0] == chain.back().nodes[2] ? chain.push_back(*next) : chain.push_front(*next);
      sides.erase(next);
    }
    ordered.insert(ordered.end(), chain.begin(), chain.end());
  }
  return ordered;
}

/// Sides of all elements by their mid-side node; on the boundary there is one.
std::multimap<int, Side> sides_by_middle(const Mesh& mesh) {
  std::multimap<int, Side> sides;
  for (int e = 0; e < static_cast<int>(mesh.elements.size()); ++e) {
    const auto& n = mesh.elements[e];
    for (int k = 0; k < 4; ++k) sides.insert({n[4 + k], Side{e, {n[k], n[4 + k], n[(k + 1) % 4]}}});
  }
  return sides;
}

/// Name of a physical group. Gmsh's library knows one group of each name; the file may have given it to several.
std::string group_name(int dim, int tag, const MshGroups& given, const std::string& file) {
  std::string name;
  gmsh::model::getPhysicalName(dim, tag, name);
  const auto entry = given.names.find({dim, tag});
  if (entry != given.names.end()) name = entry->second;
  if (name.empty())
    throw UserError(
        fmt::format("{0}: physical {1} {2} has no name, or one that another group has already; write Physical "
                    "{3}(\"name\") = {{...}} with all {1}s of that name",
                    file, dim == 1 ? "curve" : "surface", tag, dim == 1 ? "Curve" : "Surface"));
  return name;
}

/// Whether an element that lies on one of a group's entities is in the group: a file of format 2 says it of each
/// element.
bool is_in_group(std::size_t element, int group, const MshGroups& given) {
  if (!given.groups) return true;
  const auto entry = given.groups->find(element);
  return entry != given.groups->end() && entry->second.count(group) > 0;
}

std::vector<int> group_entities(int dim, int tag) {
  std::vector<int> entities;
  gmsh::model::getEntitiesForPhysicalGroup(dim, tag, entities);
  return entities;
}

/// Sides of a physical curve that are not among `sides` yet are appended: entities and their lines may be listed more
/// than once.
void add_sides_of_curve(int group, const std::string& name, const std::string& file, const MshGroups& given,
                        const std::map<std::size_t, int>& number, const std::multimap<int, Side>& all,
                        std::vector<Side>& sides) {
  for (int entity : group_entities(1, group)) {
    const ElementBlock lines = elements_of_type(kLine3, 1, entity, file);
    for (std::size_t l = 0; l < lines.tags.size(); ++l) {
      if (!is_in_group(lines.tags[l], group, given)) continue;
      const auto middle = number.find(lines.nodes[3 * l + 2]);
      const std::size_t owners = middle == number.end() ? 0 : all.count(middle->second);
      if (owners != 1)
        throw UserError(fmt::format(
            "{}: physical curve '{}' is a side of {} elements; name curves of the boundary only", file, name, owners));
      const Side& side = all.find(middle->second)->second;
      std::set<int> ends;
      for (const std::size_t end : {lines.nodes[3 * l], lines.nodes[3 * l + 1]})
        if (number.count(end) > 0) ends.insert(number.at(end));
      if (ends != std::set<int>{side.nodes[0], side.nodes[2]})
        throw UserError(
            fmt::format("{}: line {} of physical curve '{}' has the middle of an element's side but not its "
                        "ends; open the mesh in Gmsh and export it again",
                        file, lines.tags[l], name));
      const bool known = std::any_of(sides.begin(), sides.end(), [&](const Side& s) { return s.nodes == side.nodes; });
      if (!known) sides.push_back(side);
    }
  }
}

/// Elements of the file, each once however often it is listed; the map is from Gmsh's tag to our number.
std::map<std::size_t, int> read_elements(const ElementBlock& quads, const std::map<std::size_t, int>& number,
                                         Mesh& mesh) {
  std::map<std::size_t, int> element_number;
  std::map<std::array<int, 8>, int> known;
  for (std::size_t q = 0; q < quads.tags.size(); ++q) {
    std::array<int, 8> nodes{};
    for (int a = 0; a < 8; ++a) nodes[a] = number.at(quads.nodes[8 * q + a]);
    std::array<int, 8> sorted = nodes;
    std::sort(sorted.begin(), sorted.end());
    const auto [entry, is_new] = known.emplace(sorted, static_cast<int>(mesh.elements.size()));
    element_number[quads.tags[q]] = entry->second;
    if (is_new) mesh.elements.push_back(oriented(nodes, mesh));
  }
  return element_number;
}

Mesh read_model(const std::string& file) {
  Mesh mesh;
  const ElementBlock quads = elements_of_type(kQuad8, 2, -1, file);
  if (quads.tags.empty())
    throw UserError(
        fmt::format("{}: no surface elements; mesh the surfaces with 8-node quadrilaterals, and where there are "
                    "physical curves give the surfaces a Physical Surface(\"name\") too, or Gmsh does not save them",
                    file));
  const MshGroups given = read_msh_groups(file);
  const std::map<std::size_t, int> number = read_nodes(quads, file, mesh);
  const std::map<std::size_t, int> element_number = read_elements(quads, number, mesh);
  refuse_gaps(mesh, file);
  const std::multimap<int, Side> sides = sides_by_middle(mesh);
  gmsh::vectorpair groups;
  gmsh::model::getPhysicalGroups(groups);
  for (const auto& [dim, tag] : groups) {
    if (dim == 1) {
      const std::string name = group_name(dim, tag, given, file);
      add_sides_of_curve(tag, name, file, given, number, sides, mesh.edges[name]);
    } else if (dim == 2) {
      std::vector<int>& region = mesh.regions[group_name(dim, tag, given, file)];
      for (int entity : group_entities(2, tag)) {
        for (std::size_t element : elements_of_type(kQuad8, 2, entity, file).tags)
          if (is_in_group(element, tag, given)) region.push_back(element_number.at(element));
      }
      std::sort(region.begin(), region.end());
      region.erase(std::unique(region.begin(), region.end()), region.end());
    }
  }
  for (auto& [name, edge] : mesh.edges) {
    if (edge.empty())
      throw UserError(
          fmt::format("{}: physical curve '{}' has no lines; mesh the curve, or remove the group", file, name));
    edge = in_order(edge);
  }
  return mesh;
}

void generate(const std::string& file) {
  constexpr double kQuadFrontal = 8;
  double algorithm = 0;
  gmsh::option::getNumber("Mesh.Algorithm", algorithm);
  if (algorithm == kQuadFrontal)  // Gmsh 4.8 dies of a segmentation fault in it
    throw UserError(fmt::format("{}: Mesh.Algorithm = 8 is not safe in Gmsh 4.8; choose 5 or 6 and recombine", file));
  gmsh::option::setNumber("General.AbortOnError", 1);  // it throws within functions that must not throw
  gmsh::model::mesh::generate(2);
  std::string error;
  gmsh::logger::getLastError(error);
  if (!error.empty()) throw error;  // as the rest of Gmsh does
}

Mesh opened(const std::string& file) {
  const GmshSession session;
  gmsh::open(file);
  std::vector<int> types;
  std::vector<std::vector<std::size_t>> elements, element_nodes;
  gmsh::model::mesh::getElements(types, elements, element_nodes, 2);
  if (types.empty() && file.ends_with(".geo")) generate(file);
  return read_model(file);
}

}  // namespace

Mesh gmsh_mesh(const std::string& file) {
  if (!std::filesystem::is_regular_file(file)) throw UserError(fmt::format("{}: no such file; give a Gmsh mesh", file));
  const std::string extension = std::filesystem::path(file).extension().string();
  if (extension != ".msh" && extension != ".geo")
    throw UserError(fmt::format("{}: not a Gmsh file by its name; give a mesh (.msh) or a geometry (.geo)", file));
  if (const auto end = what_ends([&] { opened(file); }))
    throw UserError(fmt::format(
        "{}: Gmsh cannot read it (its library ends with {}); open it in Gmsh and export it again", file, *end));
  try {
    return opened(file);
  } catch (const std::string& error) {  // what Gmsh's API throws
    throw UserError(fmt::format("{}: Gmsh cannot read it ({}); open it in Gmsh and export it again", file, error));
  }
}

}  // namespace femxdem
