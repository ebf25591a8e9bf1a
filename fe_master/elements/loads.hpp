#pragma once

#include <functional>
#include <string>
#include <vector>

#include "formulation.hpp"
#include "load_parameters.hpp"

namespace femxdem {

/// Boundary conditions and external forces of a mesh.
class Loads {
 public:
  /// No loads yet. end_time: of the run [s].
  explicit Loads(const Formulation& formulation, double end_time = 1);

  /// Adds a load of a case. A later displacement of the same unknown replaces an earlier one.
  void add(const Load& load);
  /// Prescribes unknown `dof` as a function of time [s]; for micro-gradient unknowns the accumulated value.
  void prescribe(int dof, std::function<double(double)> value);
  /// Prescribed unknowns, ascending.
  std::vector<int> prescribed_dofs() const;
  /// Values of the prescribed unknowns (order of prescribed_dofs) at time t of a step that starts at t_n: total
  /// displacements [m], increments of the micro gradient [-].
  Eigen::VectorXd prescribed(double t_n, double t) const;
  /// Nodal forces of tractions, follower pressures and body forces at time t on the configuration x [N per
  /// thickness; N of the full circumference].
  Eigen::VectorXd external_force(const Eigen::VectorXd& x, double t) const;

  /// The tractions and pressures of these edges get a factor of their own in the place of their tables: unknown to
  /// the loads, the same for all of them.
  void release(const std::vector<std::string>& edges) { released_ = edges; }
  /// Factor that their tables give at time t (of the first one; 0 where none is released) [-].
  double released_factor(double t) const;
  /// As above with this factor of the released loads.
  Eigen::VectorXd external_force(const Eigen::VectorXd& x, double t, double released_factor) const;
  /// Nodal forces of the released loads at factor 1 [N per thickness; N].
  Eigen::VectorXd released_force(const Eigen::VectorXd& x) const;

  /// Force per current volume [N/m^3].
  BodyForce body_force;

 private:
  bool is_released(const Load& load) const;
  void add_edge_force(const Load& load, const Eigen::VectorXd& x, double value, Eigen::VectorXd& f) const;
  void add_body_force(const Eigen::VectorXd& x, Eigen::VectorXd& f) const;

  struct Prescribed {
    int dof;
    std::function<double(double)> value;
  };
  const Formulation& formulation_;
  double end_time_;
  std::vector<Prescribed> prescribed_;  // ascending in dof
  std::vector<Load> forces_;            // tractions and pressures
  std::vector<std::string> released_;   // edges
};

/// Nodes of a named edge, each once, in order along it.
std::vector<int> edge_nodes(const Mesh& mesh, const std::string& edge);

}  // namespace femxdem
