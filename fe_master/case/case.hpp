#pragma once

#include <array>
#include <string>
#include <vector>

#include "control_parameters.hpp"
#include "element_parameters.hpp"
#include "load_parameters.hpp"
#include "material_parameters.hpp"
#include "mesh.hpp"
#include "mesh_parameters.hpp"
#include "monitor.hpp"
#include "output_parameters.hpp"
#include "solver_parameters.hpp"
#include "ve_parameters.hpp"

namespace femxdem {

/// The material of one region: the base with the region's own values over it.
struct RegionMaterial {
  std::string region;
  MaterialParameters material;
};

/// The VE of one region: the base with the region's own values over it.
struct RegionVe {
  std::string region;
  VeParameters ve;
};

/// One segment of the path of a single point (`femxdem ve path`): targets at its end, reached linearly.
/// A component with neither strain nor stress given keeps the strain that it has.
struct PathSegment {
  std::array<double, 6> strain{kNotGiven, kNotGiven, kNotGiven, kNotGiven, kNotGiven, kNotGiven};  ///< logarithmic
  std::array<double, 6> stress{kNotGiven, kNotGiven, kNotGiven, kNotGiven, kNotGiven, kNotGiven};  ///< Cauchy [Pa]
  std::vector<double> deformation_gradient;  ///< F11, F12, ..., F33 at the end instead of the above, or empty
  int increments = 50;
};
/// Order of the components of a PathSegment.
inline constexpr std::array<const char*, 6> kPathComponents = {"xx", "yy", "zz", "xy", "yz", "zx"};

/// Everything a run is made of, as read from a case file (TOML) and completed with the defaults.
struct Case {
  std::string file;  ///< the case file's absolute path
  MeshParameters mesh;
  std::vector<Region> regions;
  ElementParameters element;
  MaterialParameters material;
  std::vector<RegionMaterial> material_regions;
  VeParameters ve;
  std::vector<RegionVe> ve_regions;
  std::vector<Load> loads;
  BodyForce body_force;
  ControlParameters control;
  SolverParameters solver;
  OutputParameters output;
  std::vector<Monitor> monitors;
  std::vector<PathSegment> path;
};

inline bool on_volume_elements(const Case& c) { return c.material.type == MaterialType::volume_element; }

/// What a case file must be complete for.
enum class Purpose {
  run,       ///< a boundary value problem: mesh, control, ...
  ve_path,   ///< a single material point: [material] or [ve], and [[path]]
  ve_of_run  ///< the single volume element of a boundary value problem
};

/// Reads a case file; overrides are "key=value" texts, the value in TOML ("control.step=1e-3", "load.0.value=2").
/// Relative paths of files in it are taken from the case file's folder.
/// Throws UserError with ALL mistakes, one line each: `file:line:column: what; what to do`.
Case read_case(const std::string& path, const std::vector<std::string>& overrides = {}, Purpose purpose = Purpose::run);

/// Every parameter with its value, as a case file that reads back to the same case.
std::string effective_toml(const Case& c);

/// effective_toml of what a case computes: without [output] and paths, the hashes of their contents in place of files.
std::string comparable_toml(const Case& c);

/// Reference of all parameters, by section: key, type, unit, default, bounds, text.
std::string describe_parameters();
/// The same as Markdown, one table a section.
std::string parameters_markdown();

/// Identifies what a case computes: 16 hexadecimal digits, independent of [output], paths and comments; files that the
/// case names (mesh, script, scene) count by their contents.
std::string case_hash(const Case& c);

/// The [ve] table of one volume element as a JSON object, for the Python side (yade_scripts/protocol.py,
/// make_template).
std::string ve_spec_json(const VeParameters& ve);

/// Volume elements to prepare, and which of them each Gauss point of the mesh starts from.
struct VePool {
  std::vector<VeParameters> templates;  ///< each with its own seed; only those in use, in order of first use
  std::vector<int> template_of_point;   ///< the same for all points of an element
};
/// Pool of volume elements of a case on its mesh: base and regions ([[ve.region]]) times seeds. Depends on the case
/// alone.
VePool ve_pool(const Case& c, const Mesh& mesh);

/// Material of every element of an analytic case: base and [[material.region]].
std::vector<MaterialParameters> material_of_element(const Case& c, const Mesh& mesh);

}  // namespace femxdem
