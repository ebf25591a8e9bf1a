#include "problem.hpp"

namespace femxdem {

Problem::Problem(const Case& c) : Problem(c, make_mesh(c.mesh, c.regions)) {}

Problem::Problem(const Case& c, Mesh mesh)
    : case_(c),
      mesh_(std::move(mesh)),
      formulation_(make_formulation(c.element, mesh_)),
      loads_(*formulation_, c.control.end_time) {
  loads_.body_force = c.body_force;
  if (c.control.mode != ControlMode::time) loads_.release(c.control.loads);
  for (const Load& load : c.loads) loads_.add(load);
}

std::vector<AnalyticLaw> Problem::laws() const {
  std::vector<AnalyticLaw> laws;
  for (const MaterialParameters& m : material_of_element(case_, mesh_))
    laws.insert(laws.end(), kPointsPerElement, make_law(m));
  return laws;
}

NonlinearSolver& Problem::start(MaterialPoints& points) {
  solver_.emplace(*formulation_, points, loads_, solver_parameters(case_));
  return *solver_;
}

SolverParameters solver_parameters(const Case& c) {
  SolverParameters parameters = with_default_tolerances(c.solver, on_volume_elements(c));
  if (!on_volume_elements(c)) return parameters;
  parameters.answer_at = answer_at(c.ve);
  if (!is_given(parameters.qn_first)) parameters.qn_first = 0.5;  // their stress follows the rate of strain too
  if (!is_given(parameters.qn_scatter)) parameters.qn_scatter = 0.1;
  return parameters;
}

}  // namespace femxdem
