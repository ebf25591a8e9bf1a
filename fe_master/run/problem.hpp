#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "analytic_laws.hpp"
#include "case.hpp"
#include "loads.hpp"
#include "nonlinear_solver.hpp"

namespace femxdem {

/// A boundary value problem as its case describes it: mesh, finite elements, loads, material of every point and, once
/// the points are there, the solver. The one place where they are put together.
class Problem {
 public:
  /// Throws UserError where the mesh cannot be made.
  explicit Problem(const Case& c);
  /// On a mesh made elsewhere.
  Problem(const Case& c, Mesh mesh);
  Problem(const Problem&) = delete;
  Problem& operator=(const Problem&) = delete;

  const Case& parameters() const { return case_; }
  const Mesh& mesh() const { return mesh_; }
  const Formulation& formulation() const { return *formulation_; }
  Loads& loads() { return loads_; }
  const Loads& loads() const { return loads_; }

  /// Whether the material is a volume element, not a law in closed form.
  bool on_volume_elements() const { return femxdem::on_volume_elements(case_); }
  /// Laws in closed form of all points.
  std::vector<AnalyticLaw> laws() const;
  /// Volume elements to prepare, and which of them each point starts from.
  VePool volume_elements() const { return ve_pool(case_, mesh_); }

  /// The solver at the undeformed state of the points, which are kept by reference. Throws UserError when a point
  /// cannot answer it.
  NonlinearSolver& start(MaterialPoints& points);
  /// After start().
  const NonlinearSolver& solver() const { return *solver_; }

 private:
  Case case_;
  Mesh mesh_;
  std::unique_ptr<Formulation> formulation_;
  Loads loads_;
  std::optional<NonlinearSolver> solver_;
};

/// [solver] with the defaults that depend on the material, and what the points' answers belong to.
SolverParameters solver_parameters(const Case& c);

}  // namespace femxdem
