#pragma once

#include <string>
#include <vector>

#include "given.hpp"

namespace femxdem {

enum class GlobalOperator { quasi_newton, elastic, tangent, perturbation };
enum class Refresh { frozen, step, iteration };
enum class Predictor { extrapolate, none };
enum class Acceleration { none, anderson };
/// Whether the points are evaluated after the last correction of a step, or answer from their learned tangents.
enum class LastCorrection { evaluated, learned };
struct SolverParameters {
  GlobalOperator global_operator = GlobalOperator::quasi_newton;
  Refresh refresh = Refresh::step;  ///< when the elastic operator is asked for anew
  double operator_scale = 1.0;      ///< factor on the elastic operator [-]
  Predictor predictor = Predictor::extrapolate;
  double tolerance = kNotGiven;               ///< force residual / reaction and external scale [-]
  double displacement_tolerance = kNotGiven;  ///< correction / displacement of the step [-]
  LastCorrection last_correction = LastCorrection::evaluated;
  double tolerance_over_noise = 1.5;  ///< of learned ends (Contraction) [-]
  int max_iterations = 15;
  double accept_best_factor = 1.0;  ///< best iterate accepted below this times the tolerance, and flagged [-]
  Acceleration acceleration = Acceleration::none;
  int anderson_depth = 5;
  double anderson_truncation = 1e-2;  ///< least diagonal entry of the triangular factor over the largest [-]
  bool line_search = false;
  double noise = 0.0;    ///< relative jitter of the stress of a volume element, measured; 0: not known [-]
  double qn_min = 0.02;  ///< bounds of the symmetric part of the learned tangent, elastic metric [-]
  double qn_max = 1.2;
  double qn_skew = 0.6;           ///< bound of its skew part, elastic metric [-]
  double qn_first = kNotGiven;    ///< weight of what a step's first trial teaches against the committed state [-]
  double qn_scatter = kNotGiven;  ///< of a pair's stress about what its strain explains, over it [-]
  double qn_noise = 1e-6;         ///< strain change below which nothing is learned [-]
  double reuse_below = 0.0;       ///< a point that moved by less of its step's strain answers from its tangent [-]
  double start_amplitude = 0.0;   ///< seeded random start of one step / its displacement [-]
  double start_time = 0.0;        ///< of the step that goes beyond this time [s]
  int start_seed = 1;
  double answer_at = 1;  ///< fraction of a trial that the points' stress belongs to; not of the case: answer_at(ve) [-]
  double penalty = 1e4;  ///< augmented Lagrangian: r / elastic C_1111 of the first point [-]
};

inline bool reuses(const SolverParameters& p) { return p.reuse_below > 0; }
/// What learned ends need: corrections that are whole, from tangents that are learned.
inline bool learns_whole_corrections(const SolverParameters& p) {
  return p.global_operator == GlobalOperator::quasi_newton && !p.line_search && p.acceleration == Acceleration::none;
}
inline bool learns_ends(const SolverParameters& p) { return p.last_correction == LastCorrection::learned; }

/// Columns of history.csv in which a step tells what learned tangents answered.
inline std::vector<std::string> columns_of(const SolverParameters& parameters) {
  std::vector<std::string> names;
  if (reuses(parameters)) names.insert(names.end(), {"reused", "reuse_error"});
  if (learns_ends(parameters)) names.insert(names.end(), {"tolerance", "learned_end"});
  return names;
}

/// With tolerances where none are given: 5e-3 (force) and 0.1 (displacement) for volume elements, whose noise allows no
/// less at a few evaluations; 1e-8 and 1e-6 for laws in closed form.
inline SolverParameters with_default_tolerances(SolverParameters parameters, bool volume_elements) {
  if (!is_given(parameters.tolerance)) parameters.tolerance = volume_elements ? 5e-3 : 1e-8;
  if (!is_given(parameters.displacement_tolerance)) parameters.displacement_tolerance = volume_elements ? 0.1 : 1e-6;
  return parameters;
}

}  // namespace femxdem
