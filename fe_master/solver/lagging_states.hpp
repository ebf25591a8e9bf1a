#pragma once

#include <span>
#include <vector>

#include "mid_step_points.hpp"
#include "named_arrays.hpp"
#include "point_operators.hpp"

namespace femxdem {

/// States of points that end where they were last evaluated, not where the mesh has ended after one more correction
/// (solver.last_correction = "learned"). The next step takes them from there to where the mesh is then, so that nothing
/// accumulates. Where answers belong to a fraction theta < 1 of the step (MidStepPoints), a trial from such a state to
/// the mesh's end is of
///   F + (1 - theta) (F_state - F_n),
/// and its stress is moved from there to F by the tangents that were learned until the step began: the same part in all
/// trials of the step. Left out, it would come back with the other sign, step after step.
class LaggingStates {
 public:
  /// active: false for no lag at all. points are undeformed; kept by reference.
  LaggingStates(bool active, const MidStepPoints& points)
      : active_(active && points.theta() < 1), points_(points), state_(points.size(), Tensor2::Identity()) {}

  /// A step starts, the mesh from F_n = start. What the points start from.
  std::vector<Tensor2> begin_step(std::vector<Tensor2> start, const PointOperators& operators);
  /// F of the trials for which the mesh is at F.
  std::vector<Tensor2> asked(std::vector<Tensor2> F);
  /// Moves answers to that to F.
  void complete(std::span<const Tensor2> F, std::span<Response> responses) const;
  /// The last trial is committed.
  void commit();
  /// Stresses at the ends of the committed trials, moved to where the mesh has ended, F [Pa].
  std::vector<Tensor2> end_stresses(std::span<const Tensor2> F, std::span<const Response> responses,
                                    const PointOperators& operators) const;

  void save(NamedArrays& arrays) const;
  void load(const NamedArrays& arrays);

 private:
  bool active_;
  const MidStepPoints& points_;
  std::vector<Tensor2> state_;          // F at the ends of the committed trials
  std::vector<Tensor2> ahead_, drift_;  // of this step: of the trials' F before the mesh's; stress of that, unrotated
  std::vector<Tensor2> last_;           // F of the last trial
};

}  // namespace femxdem
