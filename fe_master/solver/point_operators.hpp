#pragma once

#include <span>
#include <vector>

#include "learned_tangent.hpp"
#include "material_points.hpp"
#include "named_arrays.hpp"
#include "solver_parameters.hpp"

namespace femxdem {

/// The stiffness that the equilibrium iterations use at every material point.
///   elastic:       Eq. (2) of Nguyen et al. (2017), scaled; from the start, each step or each iteration
///   tangent:       consistent tangent that a law in closed form gives with its stress
///   perturbation:  consistent tangent by probes of the points, one per component of strain
///   quasi_newton:  each point's own tangent, learned from the responses that it has given (LearnedTangent)
class PointOperators {
 public:
  /// reference: responses of all points in the undeformed state, with their elastic stiffness; components: of the
  /// strain that the formulation can produce, which are what a point's own tangent learns.
  PointOperators(const SolverParameters& parameters, std::span<const Response> reference,
                 const StrainComponents& components);

  /// Stiffness to be asked for in every evaluation.
  Operator wanted() const;
  /// Whether the matrix of the operator is symmetric.
  bool symmetric() const { return parameters_.global_operator == GlobalOperator::elastic; }
  /// Whether the matrix made at the start of a step serves all its iterations.
  bool constant_in_step() const { return symmetric() && parameters_.refresh != Refresh::iteration; }

  /// Whether the operator depends on the trial alone, not on the ones before it.
  bool memoryless() const { return parameters_.global_operator != GlobalOperator::quasi_newton; }

  /// Start of a step from the committed deformation gradients and responses.
  void begin_step(std::span<const Tensor2> F, std::span<const Response> responses);
  /// Takes note of a trial's responses. The misfit of all points, where their tangents learn (quasi_newton).
  Misfit learn(std::span<const Tensor2> F, std::span<const Response> responses);
  /// Stress of a point at F, by its learned tangent, where it was `stress` at `from` [Pa].
  Tensor2 predict(std::size_t point, const Tensor2& F, const Tensor2& from, const Tensor2& stress) const {
    return learned_[point].predict(F, from, stress);
  }
  /// perturbation: evaluates the probes about the trial F, whose responses follow; returns the number of evaluations.
  int probe(MaterialPoints& points, std::span<const Tensor2> F, std::span<const Response> responses);
  /// dP/dF of all points at a trial [Pa].
  std::vector<Tensor4> piola(std::span<const Tensor2> F, std::span<const Response> responses) const;
  /// Smallest determinant of each point's acoustic tensor over that of its undeformed elasticity [-]: a band can form
  /// where it is not positive (Rice, 1976). Empty with the elastic operator, which knows no tangent.
  std::vector<double> acoustic_determinants(std::span<const Tensor2> F, std::span<const Response> responses) const;
  /// Smallest eigenvalue of the symmetric part of each learned tangent in the elastic metric [-]; 1 without learning.
  std::vector<double> least_eigenvalues() const;

  void save(NamedArrays& arrays) const;
  void load(const NamedArrays& arrays);

 private:
  SolverParameters parameters_;
  int components_;                                     // of strain
  std::vector<Tensor4> elastic_;                       // in use by the elastic operator
  std::vector<double> elastic_acoustic_determinants_;  // undeformed [Pa^2]
  std::vector<LearnedTangent> learned_;                // quasi_newton and perturbation
  std::vector<Tensor2> F_n_;
};

}  // namespace femxdem
