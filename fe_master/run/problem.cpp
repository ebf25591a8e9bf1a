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

Problem::Start Problem::volume_elements() const {
  VePool pool = ve_pool(case_, mesh_);
  Start start{std::move(pool.templates), {}};
  for (const int t : pool.template_of_element)
    start.template_of_point.insert(start.template_of_point.end(), kPointsPerElement, t);
  return start;
}

NonlinearSolver& Problem::start(MaterialPoints& points) {
  SolverParameters parameters = with_default_tolerances(case_.solver, on_volume_elements());
  if (on_volume_elements()) parameters.answer_at = answer_at(case_.ve);
  solver_.emplace(*formulation_, points, loads_, parameters);
  return *solver_;
}

}  // namespace femxdem
