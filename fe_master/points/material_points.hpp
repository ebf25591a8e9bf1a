#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tensor.hpp"

/// THE SEAM between the scales: the finite elements know material points only through this header,
/// and the bridge to YADE knows the finite elements only through it.
namespace femxdem {

/// What a material point reports beside its stress. One list: results files, shared memory and the Python side follow
/// it.
// clang-format off
inline constexpr std::array<std::string_view, 26> kReportFields = {
    "dem_steps",          // DEM steps of this trial
    "seconds",            // wall time of this trial [s]
    "engine_seconds",     // of which inside the DEM engine's steps [s]
    "unbalanced_force",   // mean resultant on a grain over mean contact force [-]
    "inertial_number",    // rate a sqrt(rho / p) of this trial [-]
    "time_step",          // of the DEM [s]
    "porosity",           // [-]
    "coordination",       // 2 contacts / grains [-]
    "coordination_backbone",  // the same without rattlers (grains with fewer than 2 contacts) [-]
    "fabric_xx", "fabric_yy", "fabric_zz", "fabric_xy", "fabric_yz", "fabric_zx",  // mean n_i n_j over contacts [-]
    "mean_rotation",      // mean rotation angle of the grains since the reference [rad]
    "adhesive_contacts",  // intact adhesive contacts over all contacts [-]
    "stress_asymmetry",   // |skew sigma| / |sigma| before symmetrisation [-]
    "sliding_contacts",   // contacts at the Coulomb limit over all contacts [-]
    "contacts",           // number of contacts [-]
    // Cauchy stress at the end of the trial, in the frame of the stretch U of F = R U [Pa]
    "end_stress_xx", "end_stress_yy", "end_stress_zz", "end_stress_xy", "end_stress_yz", "end_stress_zx",
};
// clang-format on

/// Place of a field in a report; throws std::out_of_range on an unknown one.
constexpr std::size_t report_index(std::string_view field) {
  for (std::size_t k = 0; k < kReportFields.size(); ++k)
    if (kReportFields[k] == field) return k;
  throw std::out_of_range("no report field named " + std::string(field));
}

struct PointReport {
  /// In the order of kReportFields; 0 where a law has no such quantity.
  std::array<double, kReportFields.size()> values{};
  double& operator[](std::string_view field) { return values[report_index(field)]; }
  double operator[](std::string_view field) const { return values[report_index(field)]; }
};

/// Its stress at the end of the trial [Pa], in the frame of the stretch.
Tensor2 end_stress(const PointReport& report);

/// Failure of a material point: a value, never an exit.
struct Failure {
  std::size_t point = 0;  ///< index in the batch
  std::string sentence;   ///< what happened, with numbers
  std::string advice;     ///< what to try
};

/// Both as sentences.
std::string describe(const Failure& failure);

/// Answer of one material point to one trial; NaN until written, so that a forgotten entry cannot pass.
struct Response {
  Tensor2 stress = Tensor2::Constant(std::numeric_limits<double>::quiet_NaN());     ///< Cauchy [Pa], tension positive
  Tensor4 stiffness = Tensor4::Constant(std::numeric_limits<double>::quiet_NaN());  ///< when asked for, see Operator
  PointReport report;
  std::optional<Failure> failure;
};

/// Which stiffness a trial is asked for.
enum class Operator {
  none,     ///< stress only; Response::stiffness stays NaN
  elastic,  ///< sigma = C : sym(grad du) with both minor symmetries [Pa]; for a volume element Eq. (2) of Nguyen et al.
            ///< (2017)
  tangent,  ///< d sigma / d(spatial gradient) [Pa], spin of the stress included; only for laws in closed form
};

/// Opaque committed states, one per point.
using SavedStates = std::vector<std::string>;

/// Takes a committed state and the points that are in it.
using TakeState = std::function<void(const std::string& state, std::span<const std::size_t> points)>;

/// Saved states, each of them in memory only when it is read.
struct StateSource {
  std::vector<int> number_of_point;      ///< of its state; points with equal states have equal numbers
  std::vector<int> history_of_point;     ///< see MaterialPoints::histories()
  std::function<std::string(int)> read;  ///< the state of that number
  /// Number and points of each state, in the order of their first points.
  std::vector<std::pair<int, std::vector<std::size_t>>> points_of_states() const;
};

/// Those of memory.
StateSource source_of(const SavedStates& states);

/// A batch of material points with a committed and a trial state.
///
/// Contract, tested on every implementation (tests/material_points_contract.hpp): equal F give equal bits; evaluate
/// leaves the committed state alone; a rejected trial leaves no trace; commit then continue is one longer path; save
/// and load give the same bits; det F <= 0 or NaN is a failure value that names the point.
class MaterialPoints {
 public:
  virtual ~MaterialPoints() = default;
  /// Number of points of the batch.
  virtual std::size_t size() const = 0;
  /// How many different histories the last trial has made of them (EqualHistories).
  virtual std::size_t distinct() const { return size(); }
  /// Of each point the number of its committed history, equal ones for equal histories, whose states may still differ
  /// in their bytes; none where nobody has looked.
  virtual std::vector<int> histories() const { return {}; }
  /// A new load step starts (also after a cut): whatever is frozen during a step's iterations, such as the number of
  /// DEM steps of a point, is chosen anew at the next evaluate.
  virtual void begin_step() {}
  /// Responses to the trial deformation gradients F (size() of them, from the reference configuration), each reached
  /// from the point's committed state.
  virtual std::vector<Response> evaluate(std::span<const Tensor2> F, Operator wanted) = 0;
  /// Adopt the last trial as the committed state.
  virtual void commit() = 0;
  /// The whole reports of the committed states; none where Response::report is whole. A trial of volume elements leaves
  /// NaN in what neither judges nor counts it, see complete_report of protocol.py. Gives up a trial that is pending.
  virtual std::vector<PointReport> reports() { return {}; }
  /// Hands over the committed states, one after another, of every point once; equal ones perhaps several times. The
  /// points themselves go on from exactly what was saved (bit-equal restart).
  virtual void save_each(const TakeState& take) = 0;
  /// Replaces the committed states by saved ones, of size() points.
  virtual void load_each(const StateSource& states) = 0;
  /// The same in memory.
  SavedStates save();
  void load(const SavedStates& states);
};

/// How often a second engine has repeated trials, and how often it has ended in the same state.
struct EngineCheck {
  long trials = 0, equal = 0;
};

/// What a trial costs, in DEM steps times contacts; counted, so that it repeats.
inline double trial_cost(double dem_steps, double contacts) { return dem_steps * (contacts > 1 ? contacts : 1); }

/// The material points that one rank serves; the bridge's volume elements, or a law in closed form in tests.
class LocalPoints : public MaterialPoints {
 public:
  /// `count` more points, each in this state, at the end of the batch: one that save() gave, which answers as its
  /// original does, to the bit, or one as it was made.
  virtual void add(const std::string& state, std::size_t count) = 0;
  /// One more point in the committed state of this one, at the end of the batch. The original goes on from exactly what
  /// was copied.
  void copy(std::size_t point) { add(save_one(point), 1); }
  /// Takes a point away; those behind it move up by one.
  virtual void remove(std::size_t point) = 0;
  /// The committed state of one point, see save_each().
  virtual std::string save_one(std::size_t point) = 0;
  /// The committed state of these points becomes this one.
  virtual void load_into(std::span<const std::size_t> points, const std::string& state) = 0;
  void load_each(const StateSource& states) override;
  /// trial_cost() of each point's next trial, to F; none where only the trial itself tells, or where a point does not
  /// keep all of its bits on its way to another rank.
  virtual std::vector<double> costs(std::span<const Tensor2>) const { return {}; }
  virtual EngineCheck engine_check() const { return {}; }
  /// That work on them.
  virtual int threads() const { return 1; }
  /// Largest memory so far of what stands behind the points [byte]: worker processes, or compact cells, which are part
  /// of their rank's own memory.
  virtual std::uint64_t peak_memory() const = 0;
};

/// Throws UserError where `states` are of another number of points.
void require_states_of(std::size_t points, const StateSource& states);

/// Gives the responses of the committed trial their whole reports.
void complete_reports(MaterialPoints& points, std::span<Response> responses);

}  // namespace femxdem
