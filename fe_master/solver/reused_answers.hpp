#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "material_points.hpp"
#include "named_arrays.hpp"
#include "point_operators.hpp"

namespace femxdem {

/// Points that have hardly moved since their last trial of a step answer from their learned tangents
/// (solver.reuse_below):
///   |U - U_last| < below |U_last - U_state|:   sigma = R (R_last^T sigma_last R_last + C : sym((U - U_last) U_n^-1))
///   R^T.
/// Such a point is asked for its last trial once more, which costs nothing where the engine keeps it (compact cells),
/// and that trial is what a commit adopts: its state ends at F_last, not at the F of the mesh, and follows at the next
/// step, whose first trial takes every point from its own state to where it shall be. So nothing accumulates.
class ReusedAnswers {
 public:
  /// below: 0 for none. The points are in their undeformed state.
  ReusedAnswers(double below, std::size_t points) : below_(below), state_(points, Tensor2::Identity()) {}

  /// A step starts: the first trial is evaluated at every point.
  void begin_step();
  /// Every point is evaluated for the rest of the step.
  void stop() { last_.clear(), stopped_ = true; }
  /// What the points are to be asked for at F.
  std::vector<Tensor2> asked(std::span<const Tensor2> F);
  /// Completes what they have said to that: the answers at F. Operators that have learned from it.
  void answer(std::span<const Tensor2> F, std::span<Response> responses, const PointOperators& operators);
  /// How far learned tangents were off in a trial of this step, where points were evaluated.
  void judge(const Misfit& misfit);
  /// Answers of the last trial that are from learned tangents.
  int count() const { return count_; }
  /// Error of what they add to the stress over what they add, as the points show it that were evaluated in this step
  /// after its first trial; 1 before any was [-].
  double misfit() const { return misfit_.expected > 0 ? std::sqrt(misfit_.missed / misfit_.expected) : 1; }
  /// Stresses of the last trial without what the learned tangents add [Pa].
  const std::vector<Tensor2>& unmoved() const { return unmoved_; }
  /// The last trial is committed.
  void commit() { state_ = last_; }

  void save(NamedArrays& arrays) const;
  void load(const NamedArrays& arrays);

 private:
  bool near(std::size_t point, const Tensor2& F) const;

  double below_;
  std::vector<Tensor2> state_;  // F of the committed states, which need not be that of the mesh
  std::vector<Tensor2> last_;   // F of the last trial of this step; empty: none
  std::vector<Tensor2> unmoved_;
  Misfit misfit_;
  int count_ = 0;
  bool stopped_ = false;
};

}  // namespace femxdem
