#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "case.hpp"
#include "learned_tangent.hpp"
#include "material_points.hpp"
#include "mid_step_points.hpp"
#include "named_arrays.hpp"

namespace femxdem {

/// Indices (i, j) of the components of a path, in the order of kPathComponents: xx, yy, zz, xy, yz, zx.
inline constexpr std::array<std::array<int, 2>, 6> kPathPairs = {{{0, 0}, {1, 1}, {2, 2}, {0, 1}, {1, 2}, {2, 0}}};

/// Six components of a symmetric tensor in that order (shear: tensor components, not doubled).
using PathVector = Eigen::Matrix<double, 6, 1>;
PathVector path_components(const Tensor2& T);
Tensor2 from_path_components(const PathVector& v);
/// Logarithmic strain ln V of F = V R, in the current frame like the Cauchy stress [-].
PathVector path_strain(const Tensor2& F);

/// One iteration of a step of a path.
struct PathIteration {
  double residual = 0;    ///< largest |target - stress| of the stress-controlled components, see PathStep
  double correction = 0;  ///< of the unknown strains over the strain of the step [-]
  double seconds = 0;     ///< wall time of the evaluation
  double engine_seconds = 0;
  double dem_steps = 0;
};

/// How a step of a path went. Residuals are relative to |sigma| / sqrt(3), the mean stress of an
/// isotropic state, of the trial or of the segment's start, whichever is larger.
struct PathStep {
  bool converged = false;
  std::vector<PathIteration> table;
  std::string reason;  ///< why not, one sentence
  std::optional<Failure> failure;
};

/// Drives ONE material point along segments whose components are strain- or stress-controlled: the unknown strains
/// follow from the stress targets by the quasi-Newton iterations of the boundary value problem (LearnedTangent over all
/// six components; start from the last increment, corrected for the carried residual), every trial from the committed
/// state through the seam. Strains are ln V with F = V R; R stays as a deformation gradient left it. Where the point
/// answers with the mean over its trial, a step's equations are those of the moment that it belongs to, as
/// NonlinearSolver says.
class PathDriver {
 public:
  /// point.size() is 1. Tolerances must be given, see solver_parameters.
  /// Throws UserError when the undeformed point fails.
  PathDriver(MaterialPoints& point, const SolverParameters& parameters);

  /// The committed state becomes the start of a segment, its tangent elastic.
  void begin_segment(const PathSegment& segment);
  /// A trial to `end` of the segment (0 to 1), from the committed state. Nothing is committed.
  PathStep solve(double end);
  /// Jitter of the stress of the converged trial: root mean square distance from a straight line of `samples` stresses
  /// at strains within +-amplitude along one random direction, over |sigma| [-]. The trial stays to be committed.
  double noise(double amplitude, int samples);
  /// Adopts the converged trial.
  void commit();

  /// What the next solve() depends on but for the point: the committed state within `segment`.
  void save(NamedArrays& arrays) const;
  void load(const NamedArrays& arrays, const PathSegment& segment);

  /// The last equilibrium: where the answer belongs in the last committed step, or the start of the segment.
  const Tensor2& F() const { return F_; }
  const Response& response() const { return response_; }
  double fraction() const { return fraction_; }  ///< of the segment

 private:
  bool stress_controlled(int component) const;
  std::vector<int> free_components() const;
  /// Deformation gradient with the strains E (ln V) in the rotation of the segment.
  Tensor2 deformation(const PathVector& E) const;
  Tensor2 prescribed_deformation(double fraction) const;
  PathVector strain_target(double fraction) const;
  PathVector stress_target(double fraction) const;
  PathVector predict(double fraction, double end) const;
  /// d stress / d strain at a trial, from the learned dP/dF [Pa].
  Eigen::Matrix<double, 6, 6> stress_by_strain(const PathVector& E, const Tensor2& stress) const;
  /// Change of the free strains that answers the stress `missing` after a given change of the others.
  PathVector correction(const PathVector& E, const Tensor2& stress, const PathVector& missing,
                        const PathVector& given) const;
  bool evaluate(const Tensor2& F, PathStep& step);
  template <class Driver, class Visit>
  static void visit_state(Driver& driver, Visit visit);

  MidStepPoints point_;
  SolverParameters parameters_;
  std::optional<LearnedTangent> tangent_;
  PathSegment segment_;
  Tensor2 R_ = Tensor2::Identity();                // of the segment
  Tensor2 F_start_ = Tensor2::Identity();          // of the segment
  PathVector E_start_, stress_start_;              // of the segment
  double fraction_ = 0, trial_fraction_ = 0;       // of the segment, committed and trial
  double end_ = 0, trial_end_ = 0;                 // where the step ends
  double last_fraction_ = 0;                       // that the last committed step of this segment advanced
  PathVector last_E_change_ = PathVector::Zero();  // of that step
  // Stress beyond its target at the end of that step, of controlled components; 0 for theta = 1.
  PathVector lacking_ = PathVector::Zero();
  Tensor2 F_ = Tensor2::Identity(), trial_F_ = Tensor2::Identity();
  Tensor2 F_end_ = Tensor2::Identity();  // committed, of the end of the step
  Response response_, trial_;
};

}  // namespace femxdem
