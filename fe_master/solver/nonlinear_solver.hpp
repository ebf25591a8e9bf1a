#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "acceleration.hpp"
#include "assembler.hpp"
#include "control.hpp"
#include "convergence.hpp"
#include "formulation.hpp"
#include "lagging_states.hpp"
#include "linear_solver.hpp"
#include "loads.hpp"
#include "material_points.hpp"
#include "mid_step_points.hpp"
#include "point_operators.hpp"
#include "reused_answers.hpp"
#include "solver_parameters.hpp"

namespace femxdem {

/// One equilibrium iteration: one evaluation of all points (and its probes), and the correction that it asks for.
struct Iteration {
  double residual = 0;     ///< free forces over reactions and external forces, and reuse_error [-]
  double reuse_error = 0;  ///< what the error of answers from learned tangents may add to the residual, estimated [-]
  double correction = 0;   ///< displacement correction over the step's displacement [-]
  double gap = 0;          ///< constraints: second gradient over the step's micro gradient, measure over its change [-]
  int element = 0;         ///< whose nodes are farthest out of balance
  double engine_seconds = 0;    ///< inside the DEM engine, all points [s]
  double longest_point = 0;     ///< the busiest point [s]
  double evaluate_seconds = 0;  ///< wall time of the evaluation [s]
  double solve_seconds = 0;     ///< wall time of assembly and solution [s]
  std::string note;             ///< what was special about it; mostly empty
};

/// What became of a step.
struct StepResult {
  bool converged = false;
  bool stopped = false;         ///< dropped, because the run is to end
  bool learned_at_end = false;  ///< its last correction was answered by learned tangents
  bool best_accepted = false;   ///< accepted above the tolerance, below accept_best_factor times it
  double tolerance = 0;         ///< that its residual was held against (Contraction) [-]
  int evaluations = 0;          ///< VE evaluations: every point strained once
  double dem_steps = 0;         ///< DEM steps of all points
  long reused = 0;              ///< answers of points from their learned tangents (ReusedAnswers)
  std::vector<Iteration> table;
  std::string reason;              ///< why it did not converge, one sentence
  std::optional<Failure> failure;  ///< of a point, when that is the reason

  int iterations() const { return static_cast<int>(table.size()); }
};

/// A state in equilibrium, of one moment.
struct Equilibrium {
  double time = 0;              ///< [s]
  Eigen::VectorXd x;            ///< unknowns (Formulation)
  Eigen::VectorXd multipliers;  ///< of the constraints (Formulation) [Pa]
  double load_factor = 0;       ///< of the released loads (Loads::release) [-]
  std::vector<Tensor2> F;
  std::vector<Response> responses;
  Eigen::VectorXd internal,
      external;  ///< nodal forces of all unknowns [N per thickness, N]; their difference: reaction
  /// What internal forces may have beyond the external ones: of what the step's start lacked, that which is still on
  /// its way out (MidStepPoints); 0 for theta = 1 and where prescribed.
  Eigen::VectorXd leaving;

  Configuration configuration() const { return {x, multipliers, F}; }
  Eigen::VectorXd out_of_balance() const { return external + leaving - internal; }
};

/// What a step starts from: the end of the step before, which lies beyond its equilibrium where answers belong to a
/// fraction theta < 1 of a step.
struct StepStart {
  double time = 0;              ///< [s]
  Eigen::VectorXd x;            ///< unknowns (Formulation)
  Eigen::VectorXd multipliers;  ///< of the constraints (Formulation) [Pa]; for theta < 1 alone, as the next two
  double load_factor = 0;       ///< of the released loads [-]
  Eigen::VectorXd lacking;      ///< internal less external forces of the stresses there; 0 where prescribed
};

/// Equilibrium of the finite elements with their material points, step by step.
///
/// Every trial strains the points from their committed state by the step's total increment; a step that fails leaves
/// no trace, and the trial that satisfied equilibrium is the state that is committed.
///
/// Where the points answer with the mean over their trials (SolverParameters::answer_at = theta < 1), forces balance at
/// t_n + theta dt: the unknowns of a step are those of that moment, loads are taken there, and what is committed is
/// x_n + (x - x_n) / theta. Prescribed values are met at the end. Of what the stresses at the step's start lack of
/// balance, 1 - theta may be left at theta. Second order in dt (README of validation/quasi_static).
class NonlinearSolver {
 public:
  /// Evaluates the undeformed state, whose stiffness C_1111 (of the first point) gives the penalty of the constraints
  /// its unit. Throws UserError when a point cannot answer it.
  NonlinearSolver(Formulation& formulation, MaterialPoints& points, const Loads& loads,
                  const SolverParameters& parameters);

  /// Solves the step from the committed state to time t_n + dt and commits it if it converges. With a target, the
  /// factor of the released loads is an unknown and the measure's value the equation for it.
  StepResult solve_step(double dt, const std::optional<MeasureTarget>& target = {});

  /// Asked before every evaluation: where it says so, the step is dropped.
  void stop_when(std::function<bool()> told_to_end) { told_to_end_ = std::move(told_to_end); }

  /// The last equilibrium found, at theta of the last step: that which curves and fields show.
  const Equilibrium& committed() const { return committed_; }
  /// Gives the committed responses their whole reports, which cost volume elements as much as a trial.
  void complete_reports();
  /// The end of the last step [s]: committed().time for theta = 1.
  double time() const { return start_.time; }
  /// From the committed equilibrium to that of a step dt [s]: dt for theta = 1.
  double span(double dt) const { return points_.theta() == 1 ? dt : trial_time(dt) - committed_.time; }
  const PointOperators& operators() const { return operators_; }
  /// Out-of-balance force of a state over its reactions and external forces [-].
  double relative_residual(const Equilibrium& state) const;
  /// The same of the nodes of each element.
  std::vector<double> element_residuals(const Equilibrium& state) const;

  void save(NamedArrays& arrays) const;
  /// Goes on from saved arrays; the points must have been loaded before.
  void load(const NamedArrays& arrays);

 private:
  double trial_time(double dt) const;
  void begin_step(Equilibrium& trial, double dt);
  void predict(Equilibrium& trial, double dt);
  StepStart end_of(const Equilibrium& trial, double dt) const;
  Eigen::VectorXd free_part(Eigen::VectorXd values) const;
  void start_at_random(Equilibrium& trial) const;
  bool evaluate(Equilibrium& trial, StepResult& result);
  double reuse_error(const Equilibrium& trial) const;
  struct Correction {
    Eigen::VectorXd x;
    double load_factor = 0;
  };
  std::optional<Correction> correction(const Equilibrium& at, const Eigen::VectorXd& x, const Eigen::VectorXd& residual,
                                       const Eigen::VectorXd& change);
  bool add_load_factor(const Eigen::VectorXd& x, Correction& c) const;
  double gap(const Equilibrium& trial) const;
  std::optional<Eigen::VectorXd> correct(const Equilibrium& trial, Iteration& now);
  Eigen::VectorXd unknowns(const Equilibrium& trial) const;
  void move(Equilibrium& trial, const Eigen::VectorXd& z);
  AndersonAcceleration acceleration() const;
  bool converged(const Iteration& iteration) const;
  bool correct_unevaluated(Equilibrium& trial, const Eigen::VectorXd& z, StepResult& result);
  bool accept_best(Equilibrium& best, StepResult& result);
  void give_up(Equilibrium& best, double dt, const ResidualHistory& history, StepResult& result);
  void commit(Equilibrium& trial, double dt);
  Eigen::VectorXd scaled_residual(const Equilibrium& state) const;
  std::vector<double> of_elements(const Eigen::VectorXd& residual) const;

  Formulation& formulation_;
  MidStepPoints points_;
  const Loads& loads_;
  SolverParameters parameters_;
  std::vector<int> prescribed_;
  Assembler assembler_;
  LinearSolver linear_solver_;
  bool factorised_in_step_ = false;
  Equilibrium committed_;
  StepStart start_;
  struct Increment {  // between the last two equilibria
    double dt = 0;
    Eigen::VectorXd x, multipliers, external;
    double load_factor = 0;
  };
  Increment last_;
  std::optional<MeasureTarget> target_;  // of the step under way
  PointOperators operators_;
  ReusedAnswers reuse_;
  Contraction contraction_;
  LaggingStates lagging_;
  double penalty_;  // r of the augmented Lagrangian [Pa]
  std::function<bool()> told_to_end_ = [] { return false; };
};

}  // namespace femxdem
