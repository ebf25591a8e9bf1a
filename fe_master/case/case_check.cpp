#include "case_check.hpp"

#include <fmt/core.h>

#include <Eigen/Dense>
#include <map>
#include <optional>
#include <set>

#include "errors.hpp"
#include "formulation.hpp"
#include "history.hpp"
#include "mesh.hpp"

namespace femxdem {

namespace {

/// Least force tolerance over the relative noise of the stress: below it, the residual of a mesh in equilibrium is
/// noise.
constexpr double kNoiseMargin = 30;

using Keys = std::vector<std::string>;

/// Keys that belong to another choice than the one made.
void refuse(Mistakes& m, const std::string& section, const Keys& keys, const std::string& choice) {
  for (const std::string& key : keys) {
    const std::string full = section + "." + key;
    if (m.has(full)) m.add(full, fmt::format("{} is of no use with {}; remove it", full, choice));
  }
}

// ---- mesh and regions

void check_mesh_keys(const Case& c, Mistakes& m) {
  const Keys rectangle = {"width", "height", "nx", "ny"}, annulus = {"inner_radius", "outer_radius", "nr", "nt"};
  const Keys gmsh = {"file"};
  require(m, "mesh", {"type"}, "rectangle, annulus or gmsh");
  if (m.wrong("mesh.type") || !m.has("mesh.type")) return;
  const MeshType type = c.mesh.type;
  const std::string name = type == MeshType::rectangle ? "rectangle" : type == MeshType::annulus ? "annulus" : "gmsh";
  const std::string choice = "mesh.type = \"" + name + "\"";
  for (const auto& [keys, of] : {std::pair{rectangle, MeshType::rectangle}, std::pair{annulus, MeshType::annulus},
                                 std::pair{gmsh, MeshType::gmsh}}) {
    if (of == type)
      require(m, "mesh", keys, choice);
    else
      refuse(m, "mesh", keys, choice);
  }
  if (c.mesh.inner_radius >= c.mesh.outer_radius)
    m.add("mesh.inner_radius", "mesh.inner_radius is not below mesh.outer_radius; exchange or correct them");
  if (type == MeshType::annulus && c.mesh.angle == 0.0)
    m.add("mesh.angle", "mesh.angle = 0 leaves no sector; give up to 360 degrees");
}

/// Mesh of the case without its regions, if it can be made.
std::optional<Mesh> mesh_of(const Case& c, Mistakes& m) {
  if (m.wrong("mesh")) return std::nullopt;
  try {
    return make_mesh(c.mesh, {});
  } catch (const UserError& error) {
    m.add("mesh", error.what());
    return std::nullopt;
  }
}

/// A point of a load outside the mesh's bounding box is a slip, not a place.
void check_points(const Case& c, const Mesh& mesh, Mistakes& m) {
  Eigen::AlignedBox2d box;
  for (const Point2& x : mesh.nodes) box.extend(x);
  const double slack = 1e-6 * box.diagonal().norm();
  for (std::size_t i = 0; i < c.loads.size(); ++i) {
    const auto& p = c.loads[i].point;
    if (p.size() == 2 && box.exteriorDistance(Point2(p[0], p[1])) > slack)
      m.add(
          fmt::format("load.{}.point", i),
          fmt::format("the point ({:g}, {:g}) lies outside the mesh, which spans ({:g}, {:g}) to ({:g}, {:g}); move it",
                      p[0], p[1], box.min().x(), box.min().y(), box.max().x(), box.max().y()));
  }
}

/// What the formulation has to say about the mesh.
void check_formulation(const Case& c, const Mesh& mesh, Mistakes& m) {
  if (m.wrong("element")) return;
  try {
    make_formulation(c.element, mesh);
  } catch (const UserError& error) {
    m.add("mesh", error.what());
  }
}

/// Names of the mesh's edges, as far as they can be known.
std::optional<std::set<std::string>> edge_names(const Case& c, const std::optional<Mesh>& mesh, const Mistakes& m) {
  std::set<std::string> names;
  if (mesh) {
    for (const auto& [name, sides] : mesh->edges) names.insert(name);
    return names;
  }
  if (!m.has("mesh.type") || m.wrong("mesh.type") || c.mesh.type == MeshType::gmsh) return std::nullopt;
  return c.mesh.type == MeshType::rectangle ? std::set<std::string>{"bottom", "right", "top", "left"}
                                            : std::set<std::string>{"inner", "outer", "start", "end"};
}

void check_region(const Region& region, const std::string& key, Mistakes& m) {
  if (region.name.empty()) m.add(key, "the region has no name; give name = \"...\"");
  if (region.box.empty() == region.elements.empty() && !m.wrong(key))
    m.add(key, fmt::format("region '{}' needs either box or elements; give one of them", region.name));
  if (region.box.size() == 4 && (region.box[0] >= region.box[2] || region.box[1] >= region.box[3]))
    m.add(key + ".box",
          fmt::format("the box of region '{}' is empty; give [x0, y0, x1, y1] with x0 < x1 and y0 < y1", region.name));
}

/// Checks [[region]] one by one on the mesh; returns the names of all regions.
std::set<std::string> check_regions(const Case& c, const std::optional<Mesh>& mesh, Mistakes& m) {
  std::set<std::string> names;
  if (mesh) {
    for (const auto& [name, elements] : mesh->regions) names.insert(name);
  }
  for (std::size_t i = 0; i < c.regions.size(); ++i) {
    const std::string key = fmt::format("region.{}", i);
    check_region(c.regions[i], key, m);
    if (!names.insert(c.regions[i].name).second)
      m.add(key, fmt::format("region '{}' is named twice; choose another name", c.regions[i].name));
    if (!mesh || m.wrong(key)) continue;
    try {
      Mesh with_region = *mesh;
      add_region(with_region, c.regions[i]);
    } catch (const UserError& error) {
      m.add(key, error.what());
    }
  }
  return names;
}

// ---- element, material, volume element

void check_element(const Case& c, Mistakes& m) {
  if (c.element.type == ElementType::axisymmetric)
    refuse(m, "element", {"D", "mindlin"}, "element.type = \"axisymmetric\"");
  if (c.element.type != ElementType::second_gradient || m.wrong("element")) return;
  const bool D = m.has("element.D"), mindlin = m.has("element.mindlin");
  if (!D && !mindlin) m.add("element", "element.type = \"second_gradient\" needs a modulus; give element.D (in N)");
  if (D && mindlin) m.add("element.mindlin", "element.D and element.mindlin are two laws; remove one of them");
}

Keys needed_by(MaterialType type) {
  switch (type) {
    case MaterialType::volume_element:
      return {};
    case MaterialType::elastic:
    case MaterialType::jaumann:
      return {"young"};
    case MaterialType::von_mises:
      return {"young", "yield_stress"};
    case MaterialType::drucker_prager:
      return {"young", "cohesion"};
    case MaterialType::bilinear:
      return {"A1", "A2", "limit_strain"};
  }
  return {};
}

void check_material(const Case& c, Mistakes& m) {
  if (!m.wrong("material.type")) require(m, "material", needed_by(c.material.type), "for this material.type");
  if (c.material.dilatancy_angle > c.material.friction_angle)
    m.add("material.dilatancy_angle", "material.dilatancy_angle is above friction_angle; lower it");
  if (on_volume_elements(c)) {
    if (!c.material_regions.empty())
      m.add("material.region", "[[material.region]] is of no use with volume elements; use [[ve.region]]");
  } else if (!c.ve_regions.empty()) {
    m.add("ve.region", "[[ve.region]] is of no use with a closed-form material; use [[material.region]]");
  }
}

/// The paper's law is one of compact cells, and of packings that are prepared for it.
void check_paper_law(const VeParameters& ve, const std::string& key, Mistakes& m) {
  if (ve.engine == EngineChoice::yade)
    m.add(key + ".contact_law",
          "ve.contact_law = \"paper\" is a law of compact cells, which YADE has not; set ve.engine = \"auto\" or "
          "\"compact\", or contact_law = \"adhesive\"");
  if (ve.source != VeSource::prepare)
    m.add(
        key + ".contact_law",
        "ve.contact_law = \"paper\" needs ve.source = \"prepare\"; a script or a scene brings its own law, remove it");
  if (ve.hold_steps > 0 && ve.answer == VeAnswer::mean)
    m.add(key + ".hold_steps",
          "ve.hold_steps > 0 has no mean that belongs to mid-step; set ve.answer = \"end\", or hold_steps = 0");
}

void check_other_law(const VeParameters& ve, const std::string& key, Mistakes& m) {
  for (const auto& [name, used] : {std::pair{"viscous_damping", ve.viscous_damping > 0.0},
                                   {"start_at_rest", ve.start_at_rest},
                                   {"hold_steps", ve.hold_steps > 0}})
    if (used)
      m.add(fmt::format("{}.{}", key, name),
            fmt::format("ve.{} is a switch of contact_law = \"paper\" alone; set that law, or remove {}", name, name));
}

void check_one_ve(const VeParameters& ve, const std::string& key, Mistakes& m) {
  if (ve.source == VeSource::scene && ve.scene.empty() && !m.has(key + ".scene"))
    m.add(key + ".source", "ve.source = \"scene\" needs a file; give ve.scene");
  if (ve.source == VeSource::script && ve.script.empty() && !m.has(key + ".script"))
    m.add(key + ".source", "ve.source = \"script\" needs a file; give ve.script");
  if (!ve.script.empty() && ve.source != VeSource::script)
    m.add(key + ".script", "ve.script is given but not used; set ve.source = \"script\" or remove it");
  if (!ve.scene.empty() && ve.source != VeSource::scene)
    m.add(key + ".scene", "ve.scene is given but not used; set ve.source = \"scene\" or remove it");
  if (ve.contact_law == ContactLaw::friction && ve.cohesion > 0.0)
    m.add(key + ".cohesion",
          "ve.cohesion > 0 needs contact_law = \"adhesive\" or \"bonded\"; set one, or cohesion = 0");
  const bool paper = ve.contact_law == ContactLaw::paper;
  const bool adhesion = (paper || ve.contact_law == ContactLaw::adhesive) && ve.cohesion > 0.0;
  if (ve.new_contacts == NewContacts::adhesive && !adhesion)
    m.add(key + ".new_contacts",
          "ve.new_contacts = \"adhesive\" needs contact_law = \"adhesive\" or \"paper\", and cohesion > 0; set both or "
          "remove it");
  if (paper)
    check_paper_law(ve, key, m);
  else
    check_other_law(ve, key, m);
}

void check_ve(const Case& c, Mistakes& m) {
  check_one_ve(c.ve, "ve", m);
  if (c.ve.assignment == Assignment::random && c.ve.seeds.size() < 2)
    m.add("ve.assignment", "ve.assignment = \"random\" needs a pool; give ve.seeds = [1, 2, ...]");
  for (std::size_t i = 0; i < c.ve_regions.size(); ++i)
    check_one_ve(c.ve_regions[i].ve, fmt::format("ve.region.{}", i), m);
}

template <class R>
void check_region_names(const std::vector<R>& regions, const std::string& section, const std::set<std::string>& known,
                        Mistakes& m) {
  for (std::size_t i = 0; i < regions.size(); ++i)
    require_known(regions[i].region, known, "region", fmt::format("{}.{}.region", section, i), m);
}

// ---- control, solver, monitors

void check_control(const Case& c, Mistakes& m) {
  require(m, "control", {"end_time"}, "s");
  if (!is_given(c.control.step))
    require(m, "control", {"step"},
            c.ve.preset == VePreset::none ? "s" : "s; a preset finds it where edges of a rectangle are moved in time");
  if (c.control.step > c.control.end_time) m.add("control.step", "control.step is above end_time; lower it");
  if (c.control.min_step > c.control.step) m.add("control.min_step", "control.min_step is above step; lower it");
  if (c.control.max_step < c.control.step) m.add("control.max_step", "control.max_step is below step; raise it");
}

/// Control by a measure of the displacements, from the start or automatic.
void check_control_measure(const Case& c, const std::optional<std::set<std::string>>& edges, Mistakes& m) {
  const Keys keys = {"loads", "measure", "measure_edge"};
  if (c.control.mode == ControlMode::time) {
    for (const char* key : {"loads", "measure_edge", "against_edge", "rate"}) {
      if (m.has(fmt::format("control.{}", key)))
        m.add(fmt::format("control.{}", key),
              fmt::format("{} is of no use with control.mode = \"time\"; set mode, or remove it", key));
    }
    return;
  }
  require(m, "control", keys, "for this control.mode");
  if (c.control.mode == ControlMode::measure) require(m, "control", {"rate"}, "for mode = \"measure\"");
  if (c.control.mode == ControlMode::automatic && m.has("control.rate"))
    m.add("control.rate", "rate is of no use with mode = \"automatic\", which goes on at the rate it finds; remove it");
  if (c.control.measure == Measure::volume && !c.control.against_edge.empty())
    m.add("control.against_edge", "against_edge is of no use with measure = \"volume\"; remove it");
  if (!edges || m.wrong("control")) return;
  require_known(c.control.measure_edge, *edges, "edge", "control.measure_edge", m);
  if (!c.control.against_edge.empty()) require_known(c.control.against_edge, *edges, "edge", "control.against_edge", m);
  const Load* first = nullptr;
  for (const std::string& edge : c.control.loads) {
    const auto is_force = [&](const Load& load) {
      return load.edge == edge && (load.kind == LoadKind::traction || load.kind == LoadKind::pressure);
    };
    const auto load = std::find_if(c.loads.begin(), c.loads.end(), is_force);
    if (load == c.loads.end()) {
      m.add("control.loads", fmt::format("edge '{}' has neither a traction nor a pressure; name one that has", edge));
    } else if (first != nullptr && first->table != load->table) {
      m.add("control.loads", fmt::format("the loads of edges '{}' and '{}' have different tables but one factor; give "
                                         "them the same table",
                                         first->edge, edge));
    } else {
      first = &*load;
    }
  }
}

void check_solver(const Case& c, Mistakes& m) {
  if (on_volume_elements(c) && c.solver.global_operator == GlobalOperator::tangent)
    m.add("solver.operator",
          "solver.operator = \"tangent\" needs a law in closed form; for volume elements use "
          "quasi_newton, elastic or perturbation");
  const double floor = kNoiseMargin * c.solver.noise;
  if (is_given(c.solver.tolerance) && c.solver.tolerance < floor)
    m.add("solver.tolerance",
          fmt::format("solver.tolerance = {:g} is below {:.1e}, which the noise {:g} of the volume element's stress "
                      "allows; raise it, or lower ve.inertial_number or take more spheres and measure again",
                      c.solver.tolerance, floor, c.solver.noise));
  if (reuses(c.solver) && c.solver.global_operator != GlobalOperator::quasi_newton)
    m.add("solver.reuse_below",
          "solver.reuse_below needs learned tangents; set solver.operator = \"quasi_newton\", or reuse_below = 0");
  if (reuses(c.solver) && on_volume_elements(c) && c.ve.answer == VeAnswer::mean)
    m.add("solver.reuse_below",
          "solver.reuse_below is for answers of a trial's end; set ve.answer = \"end\", or reuse_below = 0");
  if (learns_ends(c.solver) && !learns_whole_corrections(c.solver))
    m.add("solver.last_correction",
          "solver.last_correction = \"learned\" needs learned tangents and whole corrections; set solver.operator = "
          "\"quasi_newton\", line_search = false and acceleration = \"none\", or last_correction = \"evaluated\"");
  if (c.solver.last_correction == LastCorrection::evaluated &&
      c.solver.tolerance_over_noise != SolverParameters{}.tolerance_over_noise)
    m.add("solver.tolerance_over_noise",
          "solver.tolerance_over_noise is of no use with last_correction = \"evaluated\"; remove it");
  if (c.solver.qn_min >= c.solver.qn_max) m.add("solver.qn_min", "solver.qn_min is not below qn_max; lower it");
}

void check_monitor(const Monitor& monitor, const std::string& key, const std::set<std::string>& edges,
                   const std::set<std::string>& regions, Mistakes& m) {
  const bool of_region = monitor.quantity >= Quantity::stress_xx;
  if (of_region && !monitor.edge.empty())
    m.add(key + ".edge", "a stress is a mean over a region, not an edge; give region, or neither for the whole mesh");
  if (of_region && !monitor.region.empty()) require_known(monitor.region, regions, "region", key + ".region", m);
  if (!of_region && !monitor.region.empty())
    m.add(key + ".region", fmt::format("monitor '{}' is of an edge, not a region; give edge instead", monitor.name));
  if (!of_region && monitor.edge.empty()) m.add(key, fmt::format("monitor '{}' has no edge; give one", monitor.name));
  if (!of_region && !monitor.edge.empty()) require_known(monitor.edge, edges, "edge", key + ".edge", m);
}

void check_monitors(const Case& c, const std::optional<std::set<std::string>>& edges,
                    const std::set<std::string>& regions, Mistakes& m) {
  const std::vector<std::string> others = history_columns(columns_of(c.solver));
  std::set<std::string> names(others.begin(), others.end());
  for (std::size_t i = 0; i < c.monitors.size(); ++i) {
    const std::string key = fmt::format("monitor.{}", i);
    const std::string& name = c.monitors[i].name;
    if (name.empty() || name.find_first_of(",\"\n") != std::string::npos)
      m.add(key, "the monitor needs a name without commas and quotes; give name = \"...\"");
    if (!names.insert(name).second)
      m.add(key + ".name", fmt::format("history.csv would have two columns '{}'; choose another name", name));
    require(m, key, {"quantity"}, "what to write");
    if (edges) check_monitor(c.monitors[i], key, *edges, regions, m);
  }
}

// ---- path

void check_segment(const PathSegment& s, const std::string& key, Mistakes& m) {
  const bool F = s.deformation_gradient.size() == 9;
  for (std::size_t i = 0; i < kPathComponents.size(); ++i) {
    const bool strain = is_given(s.strain[i]), stress = is_given(s.stress[i]);
    if (strain && stress)
      m.add(fmt::format("{}.stress_{}", key, kPathComponents[i]),
            fmt::format("strain_{0} and stress_{0} are both prescribed; remove one of them", kPathComponents[i]));
    if (F && (strain || stress))
      m.add(key, fmt::format("deformation_gradient and a target of component {} exclude each other; remove one",
                             kPathComponents[i]));
  }
  if (F && Eigen::Map<const Eigen::Matrix3d>(s.deformation_gradient.data()).determinant() <= 0.0)
    m.add(key + ".deformation_gradient",
          "the determinant of deformation_gradient is not positive; correct F11, F12, ..., F33");
}

void check_path(const Case& c, Purpose purpose, Mistakes& m) {
  if (purpose == Purpose::ve_path && c.path.empty())
    m.add("path", "there is no path to follow; give at least one [[path]]");
  for (std::size_t i = 0; i < c.path.size(); ++i) check_segment(c.path[i], fmt::format("path.{}", i), m);
}

/// Only a Gmsh file can be without edges: a structured mesh has its own.
std::string nothing_named(const std::string& noun) {
  if (noun == "edge") return "the mesh has none; name them in Gmsh, as in Physical Curve(\"top\") = {3};";
  if (noun == "region") return "there is none; give a [[region]], or in Gmsh a Physical Surface(\"soil\") = {1};";
  return fmt::format("the case has no {}s", noun);
}

}  // namespace

void require(Mistakes& m, const std::string& section, const Keys& keys, const std::string& reason) {
  for (const std::string& key : keys) {
    if (!m.has(section + "." + key))
      m.add(section, fmt::format("{0}.{1} is missing; give it ({2})", section, key, reason));
  }
}

void require_known(const std::string& name, const std::set<std::string>& known, const std::string& noun,
                   const std::string& key, Mistakes& m) {
  if (known.count(name) > 0) return;
  const std::vector<std::string> all(known.begin(), known.end());
  const std::string near = nearest(name, all);
  std::string list;
  for (const std::string& other : all) list += (list.empty() ? "" : ", ") + other;
  m.add(key, fmt::format("there is no {} '{}'; {}", noun, name,
                         !near.empty()  ? fmt::format("did you mean '{}'?", near)
                         : list.empty() ? nothing_named(noun)
                                        : fmt::format("the {}s are {}", noun, list)));
}

void check_case(const Case& c, Purpose purpose, Mistakes& m) {
  check_material(c, m);
  check_ve(c, m);
  check_solver(c, m);
  check_element(c, m);
  check_path(c, purpose, m);
  if (purpose == Purpose::ve_path) return;
  check_mesh_keys(c, m);
  const std::optional<Mesh> mesh = mesh_of(c, m);
  const std::set<std::string> regions = check_regions(c, mesh, m);
  if (mesh) {
    check_region_names(c.material_regions, "material.region", regions, m);
    check_region_names(c.ve_regions, "ve.region", regions, m);
    check_points(c, *mesh, m);
    check_formulation(c, *mesh, m);
    check_axis(c, *mesh, m);
  }
  const std::optional<std::set<std::string>> edges = edge_names(c, mesh, m);
  check_loads(c, edges, m);
  check_control(c, m);
  check_control_measure(c, edges, m);
  check_monitors(c, edges, regions, m);
}

}  // namespace femxdem
