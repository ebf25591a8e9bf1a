#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "material_points.hpp"
#include "ve_parameters.hpp"
#include "worker_protocol.hpp"

namespace femxdem {

class CompactBlock;

/// The last deform of a cell.
struct CompactTrial {
  double steps = 0;    ///< DEM steps
  double rate = 0;     ///< norm of the strain rate [1/s]
  double seconds = 0;  ///< wall time
};

/// Which compilation of the step runs: all give equal bits, the fastest that the processor has is the default.
enum class Kernel { baseline, x86_64_v3, x86_64_v4 };

/// The kernels that this processor has, slowest first.
std::vector<Kernel> kernels();
/// From now on every cell of this process steps with `kernel`; for tests. Throws UserError where the processor has it
/// not. The environment's FEMXDEM_KERNEL = baseline | x86-64-v3 | x86-64-v4 is the same at the start.
void use_kernel(Kernel kernel);
Kernel kernel_in_use();

/// One volume element: spheres in a periodic cell, stepped as YADE 2023.02a steps them with
/// InteractionLoop.loopOnSortedInteractions, to the same bits, over arrays in one block of memory.
///
/// Between two calls it rests as every volume element does (yade_scripts/volume_element.py): after the contact forces,
/// before the integrator. A copy is a memcpy into memory that is reused; two cells share nothing, so that different
/// cells may be used by different threads at once. Tensors are row-major, tension positive, SI units.
class CompactCell {
 public:
  CompactCell();  ///< without spheres: only to be assigned to
  /// From what yade_scripts/compact_scene.py exports of a YADE scene. Throws UserError when it is not such an export.
  static CompactCell from_scene(std::string_view exported);
  /// From what save() gave. Throws UserError for what is truncated, changed or of another version.
  static CompactCell load(std::string_view saved);
  /// The block with its checksum: load(save()) continues with equal bits, and save() of it gives equal bytes.
  std::string save() const;

  CompactCell(const CompactCell& other);
  CompactCell& operator=(const CompactCell& other);  ///< no allocation where the memory there suffices
  CompactCell(CompactCell&&) noexcept;
  CompactCell& operator=(CompactCell&&) noexcept;
  ~CompactCell();

  struct Deformed {
    std::optional<std::string> failure;   ///< why the cell cannot go on; it is then to be thrown away
    std::array<double, 9> mean_stress{};  ///< over the steps by the trapezoidal rule, symmetrised [Pa]; see deform
  };
  /// Which stresses of a deform the mean takes, and how they weigh.
  struct Sampling {
    long every = 0;   ///< at the start, after every so many steps and at the end; 0: no mean (NaN)
    double late = 0;  ///< weight 1 + late (2 t / T - 1), 0 to 1: its centre is at t = (1/2 + late / 6) T
  };
  /// Holds the velocity gradient L [1/s] for `steps` DEM steps of info().time_step: the cell ends at
  /// (I + L time_step)^steps times where it was. Nothing happens for steps = 0: the mean is the stress.
  Deformed deform(const std::array<double, 9>& L, long steps, Sampling sampling);
  Deformed deform(const std::array<double, 9>& L, long steps) { return deform(L, steps, Sampling{}); }

  /// All velocities become zero, those of the cell's deformation too, and with them the dashpots' forces.
  void rest();
  /// `steps` further steps of the last deform, without deformation: they count as its own. Why the cell cannot go on.
  std::optional<std::string> hold(long steps);
  /// Whether YADE has the law of its contacts, and so can repeat what it does.
  bool law_of_yade() const;

  /// A cell that has become long becomes a shorter one of the same lattice, as in every step of deform: stress and
  /// contacts stay to round-off, so that shear of any size goes on. Whether it was too long.
  bool flip();

  /// Cauchy stress of Love and Weber, (1/V) sum (normal + shear force) (x) branch in the order of the contacts' ids,
  /// symmetrised [Pa].
  std::array<double, 9> stress() const;
  /// Deformation gradient of the cell from the reference (adopted) state.
  std::array<double, 9> stretch() const;
  /// What judges and counts a trial: dem_steps, seconds, engine_seconds, unbalanced_force, contacts, coordination,
  /// inertial_number, time_step, porosity, stress_asymmetry; NaN in the rest.
  PointReport trial_report() const;
  /// All of kReportFields; "seconds" and "engine_seconds" are those of the last deform. Contacts that slide or adhere
  /// are of now.
  PointReport report() const;
  /// The rest of a report that trial_report has begun, of the same state; its costs are those of the last deform.
  void complete(PointReport& report) const;
  /// Eq. (2) of Nguyen et al. (2017) with both tangents, minor-symmetrised, (3, 3, 3, 3) [Pa], or another of its kind.
  std::array<double, 81> stiffness(VeStiffness kind) const;
  VeInfo info() const;
  double time_step() const;  ///< [s]
  /// The time step becomes what the contact network of now asks for, between load steps: within 1e-12 of what
  /// yade_scripts/time_step.py finds, which sums in another order. With ve.sorted_contacts YADE's cells take it from
  /// here.
  void follow_network();

  /// What compact_scene.write_back puts into a YADE scene, in the format of the export.
  std::string to_scene() const;
  std::size_t memory() const;                            ///< [byte]
  std::size_t size() const;                              ///< spheres
  const CompactBlock& block() const { return *block_; }  ///< for tests and tools

 private:
  std::unique_ptr<CompactBlock> block_;
  CompactTrial trial_;
};

}  // namespace femxdem
