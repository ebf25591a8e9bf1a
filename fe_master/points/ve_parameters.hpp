#pragma once

#include <array>
#include <string>
#include <vector>

namespace femxdem {

/// Settings of speed against accuracy: validation/speed_accuracy has their errors.
enum class VePreset { none, fast, balanced, accurate };
enum class VeSource { prepare, scene, script };
enum class ContactLaw { adhesive, bonded, friction, paper };
enum class NewContacts { frictional, adhesive };
enum class Snapshot { fork, serialise };
/// Elastic stiffness of the contacts' springs: Eq. (2) of Nguyen et al. (2017); with the grains in equilibrium; Eq. (2)
/// as the authors' code has it, with 0.93 kn and 0.63 kt; Eq. (2) without the kt of contacts that slide.
enum class VeStiffness { affine, relaxed, reduced, sliding };
inline constexpr std::array kStiffnessWords = {"affine", "relaxed", "reduced",
                                               "sliding"};  ///< in the order of VeStiffness
enum class EngineChoice { automatic, yade, compact };
enum class VeAnswer { end, mean };
enum class Assignment { same, random };
struct VeParameters {
  VePreset preset = VePreset::none;  ///< gives what the case does not: case/preset.hpp
  VeSource source = VeSource::prepare;
  std::string script;                  ///< user's YADE script, absolute path
  std::string scene;                   ///< saved YADE scene, absolute path
  std::vector<std::string> arguments;  ///< command-line arguments of the script
  int script_steps = 1'000'000;        ///< DEM steps after which the script is stopped
  double script_seconds = 600.0;       ///< the same, for a script that makes no steps [s]
  double script_memory = 8.0;          ///< that the script may allocate [GB]
  double script_output = 100.0;        ///< that the script may print, and write into one file [MB]
  std::string scene_sha256;            ///< of the scene's file, or "any": who is asked to load it trusts it
  bool moments = true;                 ///< that contacts of a script or scene pass
  int spheres = 1000;
  double size_ratio = 1.5;                        ///< largest over smallest diameter [-]
  double kappa = 500.0;                           ///< k_n / (sigma_0 a) [-]
  double stiffness_ratio = 1.0;                   ///< k_n / k_t [-]
  double friction = 0.5;                          ///< mu, inter-granular [-]
  double cohesion = 1.0;                          ///< p* = f_c / (sigma_0 a^2) [-]
  ContactLaw contact_law = ContactLaw::adhesive;  ///< what cohesion means
  double viscous_damping = 0.0;                   ///< of a contact's normal, paper's law / critical [-]
  double compaction_friction = 0.0;               ///< mu during the preparation: sets the density [-]
  double confining_stress = 1e5;                  ///< sigma_0, isotropic [Pa], compression positive
  double mean_diameter = 1e-3;                    ///< a [m]
  double density = 2600.0;                        ///< of the grains [kg/m^3]
  int seed = 1;                                   ///< of the preparation
  double damping = 0.2;                           ///< local damping of YADE's integrator [-]
  double inertial_number = 5e-3;                  ///< I = rate a sqrt(rho / p) of a trial [-]
  VeAnswer answer = VeAnswer::end;                ///< which stress of a trial is its answer
  double mean_at = 0.5;                           ///< where in the trial the mean belongs [-]
  double time_step_safety = 0.8;                  ///< DEM time step / critical one [-]
  int min_steps = 10;                             ///< least DEM steps of a trial that strains
  bool freeze_steps = true;                       ///< the DEM steps of a load step's trials are those of its first
  double max_unbalanced_force = 0.2;              ///< an answer above is refused [-]
  bool start_at_rest = false;                     ///< a trial forgets the velocities of its start
  int hold_steps = 0;                             ///< DEM steps at the end of a trial, without deformation
  NewContacts new_contacts = NewContacts::frictional;
  VeStiffness stiffness = VeStiffness::affine;
  Snapshot snapshot = Snapshot::fork;
  EngineChoice engine = EngineChoice::automatic;  ///< compact cells where they cover the scene and equal YADE's bits
  int check_every = 0;   ///< one trial of compact cells in so many is repeated in YADE; 0: about 20 a run
  int threads = 0;       ///< of a rank, for compact cells; 0: the processors that it may use
  bool balance = false;  ///< VEs move to other ranks where that pays
  bool sorted_contacts =
      false;               ///< YADE sums forces in the order of the spheres, as compact cells do: slower, same bits
  std::vector<int> seeds;  ///< pool of VEs, or empty: only seed
  Assignment assignment = Assignment::same;  ///< of the pool to the elements
  int assignment_seed = 1;
  std::string cache;  ///< folder of prepared packings, absolute path; empty: the caller chooses
};

/// Inertial numbers up to this are slow: a trial's end is a rough function of its strain (validation/quasi_static) [-].
constexpr double kSlowTrial = 5e-3;

/// Where in a trial the stress that answers it belongs [-].
inline double answer_at(const VeParameters& ve) { return ve.answer == VeAnswer::mean ? ve.mean_at : 1; }

}  // namespace femxdem
