#include "case_parameters.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace femxdem {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr Bounds kAny{};
constexpr Bounds kPositive{0.0, kInfinity, true};
constexpr Bounds kNotNegative{0.0, kInfinity};
constexpr Bounds kAtLeastOne{1.0, kInfinity};

using Words = std::vector<std::string>;

template <class T>
constexpr Kind kind_of() {
  return static_cast<Kind>(Value(T{}).index());
}

template <class S, class T>
Parameter<S> parameter(const char* key, T S::*member, const char* unit, Bounds bounds, const char* text,
                       std::size_t size = 0) {
  return {key,
          kind_of<T>(),
          unit,
          text,
          bounds,
          size,
          {},
          [member](const S& s) { return Value(s.*member); },
          [member](S& s, const Value& v) { s.*member = std::get<T>(v); }};
}

template <class S>
Parameter<S> path(const char* key, std::string S::*member, const char* text) {
  Parameter<S> p = parameter(key, member, "", kAny, text);
  p.kind = Kind::path;
  return p;
}

/// A word of a list that names the values of an enumeration, in order; an empty word stands for "not given".
template <class S, class E>
Parameter<S> word(const char* key, E S::*member, const Words& words, const std::string& text) {
  return {key,
          Kind::word,
          "",
          text,
          kAny,
          0,
          words,
          [member, words](const S& s) { return Value(words.at(static_cast<std::size_t>(s.*member))); },
          [member, words](S& s, const Value& v) {
            for (std::size_t w = 0; w < words.size(); ++w) {
              if (words[w] == std::get<std::string>(v)) s.*member = static_cast<E>(w);
            }
          }};
}

/// The same parameter, seen in a structure that holds the inner one.
template <class S, class Inner>
Parameter<S> within(const Parameter<Inner>& p, Inner S::*inner) {
  return {p.key,
          p.kind,
          p.unit,
          p.text,
          p.bounds,
          p.size,
          p.words,
          [get = p.get, inner](const S& s) { return get(s.*inner); },
          [set = p.set, inner](S& s, const Value& v) { set(s.*inner, v); }};
}

Section<MeshParameters> mesh_section() {
  using M = MeshParameters;
  return {
      "mesh",
      "8-node quadrilaterals; edges of a rectangle: bottom, right, top, left; of an annulus: inner, outer, start, end; "
      "of a Gmsh file: its physical curves",
      {word("type", &M::type, {"rectangle", "annulus", "gmsh"}, "shape of the mesh"),
       parameter("width", &M::width, "m", kPositive, "rectangle, from x = 0"),
       parameter("height", &M::height, "m", kPositive, "rectangle, from y = 0"),
       parameter("nx", &M::nx, "", kAtLeastOne, "rectangle: elements along the width"),
       parameter("ny", &M::ny, "", kAtLeastOne, "rectangle: elements along the height"),
       parameter("inner_radius", &M::inner_radius, "m", kPositive, "annulus centred at the origin"),
       parameter("outer_radius", &M::outer_radius, "m", kPositive, "annulus"),
       parameter("angle", &M::angle, "deg", {0.0, 360.0}, "annulus: of the sector, from the x axis"),
       parameter("nr", &M::nr, "", kAtLeastOne, "annulus: elements along the radius"),
       parameter("nt", &M::nt, "", kAtLeastOne, "annulus: elements along the angle"),
       path("file", &M::file, "gmsh: mesh (.msh) or geometry (.geo) of 8-node quadrilaterals"),
       parameter("distortion", &M::distortion, "", {0.0, 0.5}, "largest random shift of interior corners / side"),
       parameter("seed", &M::seed, "", kNotNegative, "of the distortion")}};
}

Section<Region> region_section() {
  return {"region",
          "named set of elements; the physical surfaces of a Gmsh file are regions too",
          {parameter("name", &Region::name, "", kAny, "name, for material.region, ve.region and monitor"),
           parameter("box", &Region::box, "m", kAny, "x0, y0, x1, y1: elements whose centre is inside", 4),
           parameter("elements", &Region::elements, "", kNotNegative, "element numbers, instead of a box")}};
}

Section<ElementParameters> element_section() {
  using E = ElementParameters;
  return {"element",
          "8-node quadrilaterals, 2 x 2 Gauss points",
          {word("type", &E::type, {"q8", "second_gradient", "axisymmetric"},
                "q8: plane strain; second_gradient adds v_ij and lambda_ij; axisymmetric: about x = 0, x being the "
                "radius, y the axis, zz the circumference"),
           parameter("D", &E::D, "N", kPositive, "second-gradient modulus, band thickness goes as sqrt(D)"),
           parameter("mindlin", &E::mindlin, "N", kAny, "a1, ..., a5 of the general isotropic law, instead of D", 5)}};
}

Section<MaterialParameters> material_section() {
  using M = MaterialParameters;
  return {"material",
          "law of the Gauss points; compression is negative stress",
          {word("type", &M::type, {"volume_element", "elastic", "jaumann", "von_mises", "drucker_prager", "bilinear"},
                "volume_element: a YADE cell, see [ve]; the others are closed forms"),
           parameter("young", &M::young, "Pa", kPositive, "Young's modulus; all closed forms but bilinear"),
           parameter("poisson", &M::poisson, "", {-1.0, 0.5, true}, "Poisson's ratio"),
           parameter("yield_stress", &M::yield_stress, "Pa", kPositive, "von_mises: uniaxial"),
           parameter("hardening", &M::hardening, "Pa", kAny,
                     "slope of yield stress or cohesion over plastic strain; negative: softening"),
           parameter("residual_stress", &M::residual_stress, "Pa", kNotNegative,
                     "least yield stress or cohesion under softening"),
           parameter("friction_angle", &M::friction_angle, "deg", {0.0, 89.0}, "drucker_prager"),
           parameter("dilatancy_angle", &M::dilatancy_angle, "deg", {0.0, 89.0}, "drucker_prager"),
           parameter("cohesion", &M::cohesion, "Pa", kNotNegative, "drucker_prager"),
           parameter("A1", &M::A1, "Pa", kPositive, "bilinear: first slope"),
           parameter("A2", &M::A2, "Pa", kAny, "bilinear: second slope; negative: softening"),
           parameter("limit_strain", &M::limit_strain, "", kPositive, "bilinear: strain at which the slope changes"),
           parameter("initial_pressure", &M::initial_pressure, "Pa", kAny,
                     "isotropic stress of the reference state, compression positive")}};
}

/// The cell and how it is made.
std::vector<Parameter<VeParameters>> packing_parameters() {
  using V = VeParameters;
  return {word("preset", &V::preset, {"", "fast", "balanced", "accurate"},
               "gives what is not given: spheres, inertial_number, min_steps, solver.tolerance and, for a rectangle "
               "whose edges are moved in time, control.step; the log says its errors and its mesh: README of "
               "validation/speed_accuracy"),
          word("source", &V::source, {"prepare", "scene", "script"},
               "prepare: a packing by the numbers below; scene: a saved one; script: a user's YADE script"),
          path("script", &V::script, "YADE script, run unchanged, then adopted"),
          path("scene", &V::scene, "saved scene (.yade.gz, .xml.bz2), adopted"),
          parameter("scene_sha256", &V::scene_sha256, "", kAny,
                    "of that file (sha256sum), as an archive may do what its author likes; \"any\": not asked for"),
          parameter("arguments", &V::arguments, "", kAny, "command-line arguments of the script"),
          parameter("script_steps", &V::script_steps, "", kAtLeastOne, "the script is stopped after so many DEM steps"),
          parameter("script_seconds", &V::script_seconds, "s", kPositive, "and after so long, for want of steps"),
          parameter("script_memory", &V::script_memory, "GB", kPositive, "memory that the script may allocate"),
          parameter("script_output", &V::script_output, "MB", kPositive,
                    "what the script may print, and write into one file"),
          parameter("moments", &V::moments, "", kAny,
                    "false: contacts of a script or scene pass no moments (rolling and twisting resistance)"),
          parameter("spheres", &V::spheres, "", {20.0, 1e6}, "number of spheres"),
          parameter("size_ratio", &V::size_ratio, "", {1.0, 20.0}, "largest over smallest diameter"),
          parameter("kappa", &V::kappa, "", {1.0, 1e7}, "stiffness k_n / (sigma_0 a)"),
          parameter("stiffness_ratio", &V::stiffness_ratio, "", kPositive, "k_n / k_t"),
          parameter("friction", &V::friction, "", {0.0, 10.0}, "mu, inter-granular"),
          parameter("cohesion", &V::cohesion, "", kNotNegative, "p* = f_c / (sigma_0 a^2)"),
          word("contact_law", &V::contact_law, {"adhesive", "bonded", "friction", "paper"},
               "adhesive: cohesion survives sliding; bonded: the first sliding breaks it; friction: none; paper: f_n = "
               "k_n delta - f_c, |f_t| <= mu k_n delta, in compact cells alone: README of validation/contact_laws"),
          parameter("viscous_damping", &V::viscous_damping, "", {0.0, 2.0},
                    "paper: dashpot of a contact's normal / the critical one"),
          word("new_contacts", &V::new_contacts, {"frictional", "adhesive"},
               "contacts that form after the preparation: without adhesion, or adhesive as the others"),
          parameter("compaction_friction", &V::compaction_friction, "", {0.0, 10.0},
                    "mu while the packing is made: 0 is the densest"),
          parameter("confining_stress", &V::confining_stress, "Pa", kPositive, "sigma_0, compression positive"),
          parameter("mean_diameter", &V::mean_diameter, "m", kPositive, "a"),
          parameter("density", &V::density, "kg/m3", kPositive, "of the grains"),
          parameter("seed", &V::seed, "", kNotNegative, "of the preparation"),
          parameter("damping", &V::damping, "", {0.0, 0.95}, "local damping of YADE's integrator")};
}

/// How it is strained, and which element gets which.
std::vector<Parameter<VeParameters>> trial_parameters() {
  using V = VeParameters;
  return {
      parameter("inertial_number", &V::inertial_number, "", {1e-7, 1.0}, "rate a sqrt(rho / p) of a trial"),
      word("answer", &V::answer, {"end", "mean"},
           fmt::format("stress of a trial: that of its end, or the mean over it, which belongs to mid-step as then all "
                       "curves do; default mean where a boundary value problem has inertial_number <= {:g}, else end",
                       kSlowTrial)),
      parameter("mean_at", &V::mean_at, "", {0.5, 2.0 / 3},
                "where in the step the mean belongs: 0.5 all alike; beyond, later stresses weigh more"),
      parameter("time_step_safety", &V::time_step_safety, "", {0.01, 1.0}, "DEM time step / critical one"),
      parameter("min_steps", &V::min_steps, "", kAtLeastOne, "least DEM steps of a trial that strains"),
      parameter("start_at_rest", &V::start_at_rest, "", kAny, "paper: a trial begins without velocities"),
      parameter("hold_steps", &V::hold_steps, "", kNotNegative,
                "paper: DEM steps without strain at the end of a trial that strains"),
      parameter("freeze_steps", &V::freeze_steps, "", kAny,
                "the DEM steps of a load step's trials are those of its first; false: for comparison only"),
      parameter("max_unbalanced_force", &V::max_unbalanced_force, "", kPositive,
                "an answer above is refused as unstable"),
      word("stiffness", &V::stiffness, {kStiffnessWords.begin(), kStiffnessWords.end()},
           "elastic one: affine, Eq. (2); relaxed, that of the same contacts with the grains in equilibrium; reduced, "
           "Eq. (2) with 0.93 kn and 0.63 kt; sliding, Eq. (2) without the kt of contacts that slide"),
      word("engine", &V::engine, {"auto", "yade", "compact"},
           "what strains it: YADE, or compact cells, which make YADE's step to the bit; auto: compact where they can"),
      parameter("check_every", &V::check_every, "", kNotNegative,
                "one trial of compact cells in so many is repeated in YADE; 0: about 20 in a run"),
      parameter("threads", &V::threads, "", kNotNegative,
                "of a rank, for compact cells; 0: the processors that it may use"),
      parameter(
          "balance", &V::balance, "", kAny,
          "volume elements move to other ranks where it pays: compact cells before a step, others at checkpoints"),
      parameter("sorted_contacts", &V::sorted_contacts, "", kAny,
                "YADE sums forces in the order of compact cells, in three times the time: to compare bits"),
      word("snapshot", &V::snapshot, {"fork", "serialise"}, "how a trial of YADE leaves the committed state alone"),
      parameter("seeds", &V::seeds, "", kNotNegative, "pool of VEs, one a seed; empty: only seed"),
      word("assignment", &V::assignment, {"same", "random"}, "of the pool to the elements"),
      parameter("assignment_seed", &V::assignment_seed, "", kNotNegative, "of the random assignment"),
      parameter("cache", &V::cache, "", kAny,
                "folder of prepared packings; empty: packings in the working folder, or in that of the results where "
                "the former cannot be written")};
}

Section<VeParameters> ve_section() {
  Section<VeParameters> section{"ve", "volume element (VE): a periodic cell of grains in YADE", packing_parameters()};
  const std::vector<Parameter<VeParameters>> trials = trial_parameters();
  section.parameters.insert(section.parameters.end(), trials.begin(), trials.end());
  return section;
}

Section<Load> load_section() {
  return {"load",
          "a prescribed quantity, value x factor(t), on an edge; what is not prescribed is free",
          {parameter("edge", &Load::edge, "", kAny, "name of an edge of the mesh"),
           parameter("point", &Load::point, "m", kAny, "x, y: instead of an edge, the node nearest to it", 2),
           word("kind", &Load::kind, {"displacement", "velocity", "traction", "pressure", "gradient"},
                "traction: dead, per initial area; pressure: follows the edge; gradient: v_ij of the second gradient"),
           word("component", &Load::component, {"", "x", "y", "11", "12", "21", "22"},
                "x, y; of a gradient 11, 12, 21, 22; a pressure has none"),
           parameter("value", &Load::value, "m, m/s, Pa", kAny, "compression positive for a pressure; 0 m: fixed"),
           parameter("table", &Load::table, "s", kAny,
                     "[time, factor] pairs, piecewise linear; default factor: t / end_time for displacement and "
                     "gradient, t for velocity, 1 for traction and pressure")}};
}

Section<BodyForce> body_force_section() {
  return {"body_force",
          "force per volume, constant",
          {parameter("x", &BodyForce::x, "N/m3", kAny, "per current volume"),
           parameter("y", &BodyForce::y, "N/m3", kAny, "per current volume")}};
}

Section<ControlParameters> control_section() {
  using C = ControlParameters;
  return {
      "control",
      "time and its steps",
      {parameter("end_time", &C::end_time, "s", kPositive, "the run starts at 0"),
       parameter("step", &C::step, "s", kPositive, "first step"),
       parameter("min_step", &C::min_step, "s", kPositive, "below it the run ends, not converged; default step / 64"),
       parameter("max_step", &C::max_step, "s", kPositive, "largest step; default step"),
       parameter("growth", &C::growth, "", kAtLeastOne, "factor on the step after a quick one"),
       parameter("max_iterations_to_grow", &C::max_iterations_to_grow, "", kAtLeastOne,
                 "a step is quick up to so many iterations"),
       parameter("cut", &C::cut, "", {0.0, 1.0, true}, "factor on the step after a failure"),
       word("mode", &C::mode, {"time", "measure", "automatic"},
            "what drives the steps: time; a measure of the displacements, the factor of control.loads being unknown; "
            "or the one until a limit point is near, then the other"),
       parameter("loads", &C::loads, "", kAny, "edges whose tractions and pressures have the unknown factor"),
       word("measure", &C::measure, {"displacement_x", "displacement_y", "opening", "volume"},
            "of measure_edge: mean displacement; opening: against the outward normal; volume: of the cavity about the "
            "origin [m2], or about the axis of axisymmetric elements [m3]"),
       parameter("measure_edge", &C::measure_edge, "", kAny, "edge that is measured"),
       parameter("against_edge", &C::against_edge, "", kAny, "edge whose mean is subtracted"),
       parameter("rate", &C::rate, "m/s, m2/s, m3/s", kAny, "of the measure, for mode = \"measure\"")}};
}

Section<SolverParameters> solver_section() {
  using S = SolverParameters;
  return {
      "solver",
      "iterations of a step",
      {word("operator", &S::global_operator, {"quasi_newton", "elastic", "tangent", "perturbation"},
            "default quasi_newton for volume elements, tangent for closed forms"),
       word("refresh", &S::refresh, {"frozen", "step", "iteration"}, "when the elastic operator is asked for anew"),
       parameter("operator_scale", &S::operator_scale, "", kPositive, "factor on the elastic operator"),
       word("predictor", &S::predictor, {"extrapolate", "none"}, "start of a step"),
       parameter("tolerance", &S::tolerance, "", {0.0, 1.0, true},
                 "force residual / reactions and loads; default 5e-3 for volume elements, 1e-8 for closed forms"),
       parameter("displacement_tolerance", &S::displacement_tolerance, "", kPositive,
                 "correction / displacement of the step; default 0.1 for volume elements, 1e-6 for closed forms"),
       word("last_correction", &S::last_correction, {"evaluated", "learned"},
            "default learned where ve.answer is mean, else evaluated; learned: where what a correction leaves is known "
            "from the steps before to be within the tolerance, points answer to the last one from their learned "
            "tangents, unevaluated"),
       parameter(
           "tolerance_over_noise", &S::tolerance_over_noise, "", kNotNegative,
           "with learned last corrections: the residual that is to be expected may be so many times its noise, as "
           "the last steps show it, at most twice the tolerance; 0: the tolerance"),
       parameter("max_iterations", &S::max_iterations, "", kAtLeastOne, "then the step is cut"),
       parameter("accept_best_factor", &S::accept_best_factor, "", kAtLeastOne,
                 "the best iterate is accepted, and flagged, below this times the tolerance"),
       word("acceleration", &S::acceleration, {"none", "anderson"}, "on top of the operator"),
       parameter("anderson_depth", &S::anderson_depth, "", {1.0, 50.0}, "iterates remembered"),
       parameter("anderson_truncation", &S::anderson_truncation, "", {0.0, 1.0},
                 "columns that say less than this are dropped; 10 x noise / tolerance is sound"),
       parameter("line_search", &S::line_search, "", kAny, "on the residual; each trial costs an evaluation"),
       parameter("noise", &S::noise, "", kNotNegative,
                 "stress noise of the volume element (femxdem ve path --noise): a tolerance within it is refused"),
       parameter("qn_min", &S::qn_min, "", kAny, "learned tangent: least eigenvalue, elastic metric"),
       parameter("qn_max", &S::qn_max, "", kPositive, "learned tangent: largest eigenvalue, elastic metric"),
       parameter("qn_skew", &S::qn_skew, "", kNotNegative, "learned tangent: norm of the skew part, elastic metric"),
       parameter(
           "qn_first", &S::qn_first, "", {0.0, 1.0},
           "weight of what a step's first trial teaches against its start; default 0.5 for volume elements, else 1"),
       parameter(
           "qn_scatter", &S::qn_scatter, "", {0.0, 1.0},
           "of a pair's stress about what its strain explains, over it; 0: every pair is met exactly; default 0.1 "
           "for volume elements, else 0"),
       parameter("qn_noise", &S::qn_noise, "", kNotNegative, "strain change below which nothing is learned"),
       parameter("reuse_below", &S::reuse_below, "", {0.0, 1.0},
                 "a point that has moved by less of the step's strain since its last trial answers from its learned "
                 "tangent; 0: none"),
       parameter("start_amplitude", &S::start_amplitude, "", kNotNegative,
                 "random start of one step / its displacement: finds other solutions"),
       parameter("start_time", &S::start_time, "s", kNotNegative, "the random start is that of the step past this"),
       parameter("start_seed", &S::start_seed, "", kNotNegative, "of the random start"),
       parameter("penalty", &S::penalty, "", kPositive, "augmented Lagrangian: r / elastic modulus")}};
}

Section<OutputParameters> output_section() {
  using O = OutputParameters;
  return {"output",
          "files of a run",
          {parameter("directory", &O::directory, "", kAny, "folder of the results; --out comes before it"),
           parameter("every", &O::every, "", kAtLeastOne, "steps between field outputs"),
           parameter("checkpoint_every", &O::checkpoint_every, "", kNotNegative, "steps between checkpoints; 0: none"),
           parameter("checkpoint_minutes", &O::checkpoint_minutes, "min", kNotNegative,
                     "wall time after which a step is followed by a checkpoint; 0: none")}};
}

Section<Monitor> monitor_section() {
  return {"monitor",
          "a column of history.csv",
          {parameter("name", &Monitor::name, "", kAny, "name of the column"),
           word("quantity", &Monitor::quantity,
                {"reaction_x", "reaction_y", "displacement_x", "displacement_y", "length", "pressure", "stress_xx",
                 "stress_yy", "stress_zz", "stress_xy"},
                "reaction: sum over the edge [N/m; axisymmetric N, of the full circumference]; displacement: mean over "
                "the edge [m]; stress: mean over the region [Pa]"),
           parameter("edge", &Monitor::edge, "", kAny, "edge of the mesh; all but stresses"),
           parameter("region", &Monitor::region, "", kAny, "region of a stress; default: the whole mesh")}};
}

Section<PathSegment> path_section() {
  Section<PathSegment> section{
      "path",
      "segment of the path of a single point (femxdem ve path); a component with no target keeps its strain",
      {parameter("increments", &PathSegment::increments, "", kAtLeastOne, "steps of the segment"),
       parameter("deformation_gradient", &PathSegment::deformation_gradient, "", kAny,
                 "F11, F12, ..., F33 at the end, instead of strains and stresses", 9)}};
  for (std::size_t i = 0; i < kPathComponents.size(); ++i) {
    const std::string component = kPathComponents[i];
    section.parameters.push_back({"strain_" + component,
                                  Kind::number,
                                  "",
                                  "logarithmic strain at the end",
                                  kAny,
                                  0,
                                  {},
                                  [i](const PathSegment& s) { return Value(s.strain[i]); },
                                  [i](PathSegment& s, const Value& v) { s.strain[i] = std::get<double>(v); }});
    section.parameters.push_back({"stress_" + component,
                                  Kind::number,
                                  "Pa",
                                  "Cauchy stress at the end, tension positive",
                                  kAny,
                                  0,
                                  {},
                                  [i](const PathSegment& s) { return Value(s.stress[i]); },
                                  [i](PathSegment& s, const Value& v) { s.stress[i] = std::get<double>(v); }});
  }
  return section;
}

/// Section of a region's own values: its name and the base's parameters but those that hold for all regions.
template <class S, class Inner>
Section<S> region_of(const Section<Inner>& base, std::string S::*region, Inner S::*inner, const Words& common) {
  Section<S> section{base.name + ".region",
                     "values of [" + base.name + "] that differ in a region",
                     {parameter("region", region, "", kAny, "name of a region")}};
  for (const Parameter<Inner>& p : base.parameters) {
    if (std::find(common.begin(), common.end(), p.key) == common.end()) section.parameters.push_back(within(p, inner));
  }
  return section;
}

}  // namespace

const CaseSections& case_sections() {
  static const CaseSections sections = [] {
    CaseSections s{.mesh = mesh_section(),
                   .region = region_section(),
                   .element = element_section(),
                   .material = material_section(),
                   .material_region = {},
                   .ve = ve_section(),
                   .ve_region = {},
                   .load = load_section(),
                   .body_force = body_force_section(),
                   .control = control_section(),
                   .solver = solver_section(),
                   .output = output_section(),
                   .monitor = monitor_section(),
                   .path = path_section()};
    s.material_region = region_of(s.material, &RegionMaterial::region, &RegionMaterial::material, {"type"});
    s.ve_region = region_of(s.ve, &RegionVe::region, &RegionVe::ve,
                            {"preset",          "stiffness",  "engine",          "check_every",
                             "threads",         "balance",    "sorted_contacts", "snapshot",
                             "inertial_number", "answer",     "mean_at",         "min_steps",
                             "start_at_rest",   "hold_steps", "freeze_steps",    "max_unbalanced_force",
                             "seeds",           "assignment", "assignment_seed", "cache"});
    return s;
  }();
  return sections;
}

}  // namespace femxdem
