#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "case_check.hpp"

namespace femxdem {

namespace {

bool prescribes_motion(LoadKind kind) { return kind == LoadKind::displacement || kind == LoadKind::velocity; }

void check_place(const Load& load, const std::string& key, const std::optional<std::set<std::string>>& edges,
                 Mistakes& m) {
  if (load.edge.empty() == load.point.empty()) m.add(key, "the load needs either an edge or a point; give one of them");
  if (!load.edge.empty() && edges) require_known(load.edge, *edges, "edge", key + ".edge", m);
  if (!load.point.empty() && !prescribes_motion(load.kind))
    m.add(key + ".point", "only a displacement or a velocity can be prescribed at a point; give an edge");
}

void check_component(const Case& c, const Load& load, const std::string& key, Mistakes& m) {
  const bool vector = load.component == Component::x || load.component == Component::y;
  if (load.kind == LoadKind::pressure) {
    if (load.component != Component::none)
      m.add(key + ".component", "a pressure acts along the normal; remove component");
  } else if (load.kind == LoadKind::gradient) {
    if (c.element.type != ElementType::second_gradient)
      m.add(key + ".kind",
            "a gradient can be prescribed for second-gradient elements only; set element.type = "
            "\"second_gradient\", or remove this load");
    if (vector || load.component == Component::none)
      m.add(key, "a prescribed gradient needs a component of v_ij; give component = \"11\", \"12\", \"21\" or \"22\"");
  } else if (!vector) {
    m.add(key, "the load needs a direction; give component = \"x\" or \"y\"");
  }
}

void check_table(const Load& load, const std::string& key, Mistakes& m) {
  for (std::size_t i = 1; i < load.table.size(); ++i) {
    if (load.table[i][0] <= load.table[i - 1][0])
      return m.add(key + ".table",
                   fmt::format("the times of the table do not increase at {}; sort its pairs", load.table[i][0]));
  }
}

std::string target(const Load& load) {
  const std::array<const char*, 7> names = {"", "x", "y", "v11", "v12", "v21", "v22"};
  return names.at(static_cast<std::size_t>(load.component));
}

/// Contradictions with an earlier load of the same edge.
void check_against(const Load& load, const Load& earlier, const std::string& key, const std::string& earlier_key,
                   Mistakes& m) {
  if (load.edge.empty() || load.edge != earlier.edge || load.component != earlier.component) return;
  const bool essential = load.kind != LoadKind::traction && load.kind != LoadKind::pressure;
  const bool earlier_essential = earlier.kind != LoadKind::traction && earlier.kind != LoadKind::pressure;
  if (essential && earlier_essential)
    m.add(key, fmt::format("{} of edge '{}' is prescribed twice (first at {}); remove one of them", target(load),
                           load.edge, m.place(earlier_key)));
  else if (essential != earlier_essential)
    m.add(key,
          fmt::format("edge '{}' has both a displacement and a traction prescribed in {} (the other at {}); remove "
                      "one of them",
                      load.edge, target(load), m.place(earlier_key)));
}

bool holds(const Case& c, Component component) {
  return std::any_of(c.loads.begin(), c.loads.end(), [component](const Load& load) {
    return prescribes_motion(load.kind) && load.component == component;
  });
}

bool is_held(const Case& c, const std::string& edge, Component component) {
  return std::any_of(c.loads.begin(), c.loads.end(), [&](const Load& load) {
    return load.edge == edge && prescribes_motion(load.kind) && load.component == component;
  });
}

bool fully_held(const Case& c, const std::string& edge) {
  return is_held(c, edge, Component::x) && is_held(c, edge, Component::y);
}

}  // namespace

void check_axis(const Case& c, const Mesh& mesh, Mistakes& m) {
  if (c.element.type != ElementType::axisymmetric || m.wrong("element")) return;
  double radius = 0;
  for (const Point2& X : mesh.nodes) radius = std::max(radius, X.x());
  for (const auto& [name, sides] : mesh.edges) {
    const bool on_axis = std::all_of(sides.begin(), sides.end(), [&](const Side& side) {
      return std::all_of(side.nodes.begin(), side.nodes.end(),
                         [&](int node) { return std::abs(mesh.nodes[node].x()) <= 1e-9 * radius; });
    });
    if (on_axis && !is_held(c, name, Component::x))
      m.add("load",
            fmt::format("edge '{0}' lies on the axis of axisymmetric elements, where nothing moves along x; add "
                        "[[load]] edge = \"{0}\", kind = \"displacement\", component = \"x\", value = 0",
                        name));
  }
}

void check_loads(const Case& c, const std::optional<std::set<std::string>>& edges, Mistakes& m) {
  for (std::size_t i = 0; i < c.loads.size(); ++i) {
    const Load& load = c.loads[i];
    const std::string key = fmt::format("load.{}", i);
    require(m, key, {"kind", "value"}, "what is prescribed, and how much");
    if (m.wrong(key)) continue;
    check_place(load, key, edges, m);
    check_component(c, load, key, m);
    check_table(load, key, m);
    for (std::size_t j = 0; j < i; ++j) check_against(load, c.loads[j], key, fmt::format("load.{}", j), m);
    if (load.kind == LoadKind::pressure && fully_held(c, load.edge))
      m.add(key, fmt::format("edge '{}' has a pressure but is held in x and y; remove one of them", load.edge));
  }
  if (m.wrong("load")) return;
  for (const auto& [component, name] : {std::pair{Component::x, "x"}, std::pair{Component::y, "y"}}) {
    if (component == Component::x && c.element.type == ElementType::axisymmetric) continue;  // the hoops hold it
    if (!holds(c, component))
      m.add("load",
            fmt::format("nothing holds the mesh in {0}; prescribe a displacement in {0} on an edge, or pin a node: "
                        "[[load]] point = [x, y], kind = \"displacement\", component = \"{0}\", value = 0",
                        name));
  }
}

}  // namespace femxdem
