#pragma once

#include <array>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace femxdem {

/// Marks a number that the case does not give.
inline constexpr double kNotGiven = std::numeric_limits<double>::quiet_NaN();
/// Whether a number of the case is given.
inline bool is_given(double value) { return value == value; }

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

enum class ElementType { q8, second_gradient };
struct ElementParameters {
  ElementType type = ElementType::q8;
  double D = kNotGiven;         ///< second-gradient modulus, formulation with one parameter [N]
  std::vector<double> mindlin;  ///< a1..a5 of the general isotropic law instead of D [N], or empty
};

enum class MaterialType { volume_element, elastic, jaumann, von_mises, drucker_prager, bilinear };
struct MaterialParameters {
  MaterialType type = MaterialType::volume_element;
  double young = kNotGiven;         ///< Young's modulus [Pa]
  double poisson = 0.25;            ///< Poisson's ratio [-]
  double yield_stress = kNotGiven;  ///< von Mises, uniaxial [Pa]
  double hardening = 0.0;           ///< d(yield stress or cohesion)/d(plastic strain) [Pa], negative: softening
  double residual_stress = 0.0;     ///< least yield stress or cohesion under softening [Pa]
  double friction_angle = 30.0;     ///< Drucker-Prager [deg]
  double dilatancy_angle = 0.0;     ///< Drucker-Prager [deg]
  double cohesion = kNotGiven;      ///< Drucker-Prager [Pa]
  double A1 = kNotGiven;            ///< bilinear bar law: first slope [Pa]
  double A2 = kNotGiven;            ///< bilinear bar law: second slope [Pa], negative: softening
  double limit_strain = kNotGiven;  ///< bilinear bar law: strain e_l at which the slope changes [-]
  double initial_pressure = 0.0;    ///< isotropic stress of the reference state [Pa], compression positive
};
/// The material of one region: the base with the region's own values over it.
struct RegionMaterial {
  std::string region;
  MaterialParameters material;
};

/// Settings of speed against accuracy: validation/speed_accuracy has their errors.
enum class VePreset { none, fast, balanced, accurate };
enum class VeSource { prepare, scene, script };
enum class ContactLaw { adhesive, bonded, friction };
enum class NewContacts { frictional, adhesive };
enum class Snapshot { fork, serialise };
enum class VeStiffness { affine, relaxed };
enum class Assignment { same, random };
struct VeParameters {
  VePreset preset = VePreset::none;  ///< gives spheres and inertial_number where the case does not
  VeSource source = VeSource::prepare;
  std::string script;                  ///< user's YADE script, absolute path
  std::string scene;                   ///< saved YADE scene, absolute path
  std::vector<std::string> arguments;  ///< command-line arguments of the script
  int script_steps = 1'000'000;        ///< DEM steps after which the script is stopped
  double script_seconds = 600.0;       ///< the same, for a script that makes no steps [s]
  int spheres = 1000;
  double size_ratio = 1.5;                        ///< largest over smallest diameter [-]
  double kappa = 500.0;                           ///< k_n / (sigma_0 a) [-]
  double stiffness_ratio = 1.0;                   ///< k_n / k_t [-]
  double friction = 0.5;                          ///< mu, inter-granular [-]
  double cohesion = 1.0;                          ///< p* = f_c / (sigma_0 a^2) [-]
  ContactLaw contact_law = ContactLaw::adhesive;  ///< what cohesion means
  double compaction_friction = 0.0;               ///< mu during the preparation: sets the density [-]
  double confining_stress = 1e5;                  ///< sigma_0, isotropic [Pa], compression positive
  double mean_diameter = 1e-3;                    ///< a [m]
  double density = 2600.0;                        ///< of the grains [kg/m^3]
  int seed = 1;                                   ///< of the preparation
  double damping = 0.2;                           ///< local damping of YADE's integrator [-]
  double inertial_number = 5e-3;                  ///< I = rate a sqrt(rho / p) of a trial [-]
  double time_step_safety = 0.8;                  ///< DEM time step / critical one [-]
  int min_steps = 10;                             ///< least DEM steps of a trial that strains
  bool freeze_steps = true;                       ///< the DEM steps of a load step's trials are those of its first
  double max_unbalanced_force = 0.2;              ///< an answer above is refused [-]
  NewContacts new_contacts = NewContacts::frictional;
  VeStiffness stiffness = VeStiffness::affine;
  Snapshot snapshot = Snapshot::fork;
  std::vector<int> seeds;                    ///< pool of VEs, or empty: only seed
  Assignment assignment = Assignment::same;  ///< of the pool to the elements
  int assignment_seed = 1;
  std::string cache;  ///< folder of prepared packings, absolute path; empty: the caller chooses
};
/// The VE of one region: the base with the region's own values over it.
struct RegionVe {
  std::string region;
  VeParameters ve;
};

enum class LoadKind { displacement, velocity, traction, pressure, gradient };
/// x, y of a vector; xx, xy, yx, yy are "11", "12", "21", "22" of the micro gradient v_ij.
enum class Component { none, x, y, xx, xy, yx, yy };
struct Load {
  std::string edge;
  std::vector<double> point;  ///< x, y [m]: acts on the node nearest to it instead of an edge (a pin); or empty
  LoadKind kind = LoadKind::displacement;
  Component component = Component::none;
  double value = kNotGiven;                  ///< [m], [m/s], [Pa per initial area], [Pa, compression positive], [-]
  std::vector<std::array<double, 2>> table;  ///< (time, factor) pairs, piecewise linear, or empty: the default factor
};
/// Load factor at time t: from the table (constant beyond its ends), else t / end_time for displacement and gradient,
/// t for velocity, 1 for traction and pressure. The prescribed quantity is value * factor.
double load_factor(const Load& load, double time, double end_time);

struct BodyForce {
  double x = 0.0, y = 0.0;  ///< force per current volume [N/m^3]
};

enum class ControlMode { time, measure, automatic };
enum class Measure { displacement_x, displacement_y, opening, volume };
struct ControlParameters {
  double end_time = kNotGiven;     ///< [s]
  double step = kNotGiven;         ///< first step [s]
  double min_step = kNotGiven;     ///< smallest step: below it the run ends, not converged [s]
  double max_step = kNotGiven;     ///< [s]
  double growth = 1.3;             ///< factor on the step after a quick one [-]
  int max_iterations_to_grow = 6;  ///< a step is quick up to so many iterations
  double cut = 0.5;                ///< factor on the step after a failure [-]
  ControlMode mode = ControlMode::time;
  std::vector<std::string> loads;  ///< edges whose tractions and pressures get an unknown factor, unless mode is time
  Measure measure = Measure::opening;  ///< what is prescribed in its place (ControlMeasure)
  std::string measure_edge;
  std::string against_edge;  ///< whose measure is subtracted, or empty
  double rate = kNotGiven;   ///< of the measure [m/s, m^2/s]
};

enum class GlobalOperator { quasi_newton, elastic, tangent, perturbation };
enum class Refresh { frozen, step, iteration };
enum class Predictor { extrapolate, none };
enum class Acceleration { none, anderson };
struct SolverParameters {
  GlobalOperator global_operator = GlobalOperator::quasi_newton;
  Refresh refresh = Refresh::step;  ///< when the elastic operator is asked for anew
  double operator_scale = 1.0;      ///< factor on the elastic operator [-]
  Predictor predictor = Predictor::extrapolate;
  double tolerance = kNotGiven;               ///< force residual / reaction and external scale [-]
  double displacement_tolerance = kNotGiven;  ///< correction / displacement of the step [-]
  int max_iterations = 15;
  double accept_best_factor = 1.0;  ///< best iterate accepted below this times the tolerance, and flagged [-]
  Acceleration acceleration = Acceleration::none;
  int anderson_depth = 5;
  double anderson_truncation = 1e-2;  ///< least diagonal entry of the triangular factor over the largest [-]
  bool line_search = false;
  double noise = 0.0;    ///< relative jitter of the stress of a volume element, measured; 0: not known [-]
  double qn_min = 0.02;  ///< bounds of the symmetric part of the learned tangent, elastic metric [-]
  double qn_max = 1.2;
  double qn_skew = 0.6;          ///< bound of its skew part, elastic metric [-]
  double qn_first = kNotGiven;   ///< weight of what a step's first trial teaches against the committed state [-]
  double qn_noise = 1e-6;        ///< strain change below which nothing is learned [-]
  double start_amplitude = 0.0;  ///< seeded random start of one step / its displacement [-]
  double start_time = 0.0;       ///< of the step that goes beyond this time [s]
  int start_seed = 1;
  double penalty = 1e4;  ///< augmented Lagrangian: r / Young-like modulus of the element [-]
};

struct OutputParameters {
  std::string directory;     ///< relative to the current folder; empty: the caller chooses
  int every = 1;             ///< steps between field outputs
  int checkpoint_every = 0;  ///< steps between checkpoints; 0: none
};

enum class Quantity {
  reaction_x,
  reaction_y,  ///< sum over the edge [N/m]
  displacement_x,
  displacement_y,  ///< mean over the edge [m]
  length,          ///< of the deformed edge [m]
  pressure,        ///< follower pressure on the edge [Pa]
  stress_xx,
  stress_yy,
  stress_zz,
  stress_xy  ///< volume mean over the region, or over the mesh [Pa]
};
/// A column of history.csv.
struct Monitor {
  std::string name;
  Quantity quantity = Quantity::reaction_y;
  std::string edge;    ///< of reactions, displacements, length, pressure
  std::string region;  ///< of stresses; empty: the whole mesh
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

/// What a case file must be complete for.
enum class Purpose {
  run,     ///< a boundary value problem: mesh, control, ...
  ve_path  ///< a single material point: [material] or [ve], and [[path]]
};

/// Reads a case file; overrides are "key=value" texts, the value in TOML ("control.step=1e-3", "load.0.value=2").
/// Relative paths of files in it are taken from the case file's folder.
/// Throws UserError with ALL mistakes, one line each: `file:line:column: what; what to do`.
Case read_case(const std::string& path, const std::vector<std::string>& overrides = {}, Purpose purpose = Purpose::run);

/// Every parameter with its value, as a case file that reads back to the same case.
std::string effective_toml(const Case& c);

/// Reference of all parameters, by section: key, type, unit, default, bounds, text.
std::string describe_parameters();

/// effective_toml of what a case computes: without [output] and paths, the hashes of their contents in place of files.
std::string comparable_toml(const Case& c);

/// Identifies what a case computes: 16 hexadecimal digits, independent of [output], paths and comments; files that the
/// case names (mesh, script, scene) count by their contents.
std::string case_hash(const Case& c);

/// The [ve] table of one volume element as a JSON object, for the Python side (yade_scripts/protocol.py,
/// make_template).
std::string ve_spec_json(const VeParameters& ve);

struct Mesh;
/// Volume elements to prepare, and which of them each element of the mesh starts from.
struct VePool {
  std::vector<VeParameters> templates;  ///< each with its own seed; only those in use, in order of first use
  std::vector<int> template_of_element;
};
/// Pool of volume elements of a case on its mesh: base and regions ([[ve.region]]) times seeds. Depends on the case
/// alone.
VePool ve_pool(const Case& c, const Mesh& mesh);

/// Material of every element of an analytic case: base and [[material.region]].
std::vector<MaterialParameters> material_of_element(const Case& c, const Mesh& mesh);

}  // namespace femxdem
