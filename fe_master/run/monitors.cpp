#include "monitors.hpp"

#include <algorithm>

#include "edge_samples.hpp"

namespace femxdem {
namespace {

double sum_over_edge(const Mesh& mesh, const std::string& edge, const Eigen::VectorXd& nodal, int component) {
  double sum = 0;
  for (const int node : edge_nodes(mesh, edge)) sum += nodal[2 * node + component];
  return sum;
}

double mean_displacement(const Mesh& mesh, const std::string& edge, const Eigen::VectorXd& x, int component) {
  return sum_over_edge(mesh, edge, x, component) / static_cast<double>(edge_nodes(mesh, edge).size());
}

double deformed_length(const Mesh& mesh, const std::string& edge, const Eigen::VectorXd& x) {
  double length = 0;
  for (const EdgeSample& g : edge_samples(mesh, edge, x)) length += g.weight * g.tangent.norm();
  return length;
}

double pressure(const Case& c, const std::string& edge, const Equilibrium& state) {
  const auto& loads = c.control.loads;
  const bool released = c.control.mode != ControlMode::time && std::count(loads.begin(), loads.end(), edge) > 0;
  double sum = 0;
  for (const Load& load : c.loads) {
    if (load.kind == LoadKind::pressure && load.edge == edge)
      sum += load.value * (released ? state.load_factor : load_factor(load, state.time, c.control.end_time));
  }
  return sum;
}

double mean_stress(const Formulation& formulation, const std::string& region, const Equilibrium& state, int i, int j) {
  double sum = 0, volume = 0;
  const auto add = [&](std::size_t e) {
    for (std::size_t p = kPointsPerElement * e; p < kPointsPerElement * (e + 1); ++p) {
      const double weight = formulation.shapes(p).weight * state.F[p].determinant();
      sum += weight * state.responses[p].stress(i, j);
      volume += weight;
    }
  };
  if (region.empty()) {
    for (std::size_t e = 0; e < formulation.mesh().elements.size(); ++e) add(e);
  } else {
    for (const int e : formulation.mesh().regions.at(region)) add(static_cast<std::size_t>(e));
  }
  return sum / volume;
}

double value(const Case& c, const Formulation& formulation, const Equilibrium& state, const Monitor& monitor) {
  const Mesh& mesh = formulation.mesh();
  switch (monitor.quantity) {
    case Quantity::reaction_x:
      return sum_over_edge(mesh, monitor.edge, state.internal - state.external, 0);
    case Quantity::reaction_y:
      return sum_over_edge(mesh, monitor.edge, state.internal - state.external, 1);
    case Quantity::displacement_x:
      return mean_displacement(mesh, monitor.edge, state.x, 0);
    case Quantity::displacement_y:
      return mean_displacement(mesh, monitor.edge, state.x, 1);
    case Quantity::length:
      return deformed_length(mesh, monitor.edge, state.x);
    case Quantity::pressure:
      return pressure(c, monitor.edge, state);
    case Quantity::stress_xx:
      return mean_stress(formulation, monitor.region, state, 0, 0);
    case Quantity::stress_yy:
      return mean_stress(formulation, monitor.region, state, 1, 1);
    case Quantity::stress_zz:
      return mean_stress(formulation, monitor.region, state, 2, 2);
    case Quantity::stress_xy:
      return mean_stress(formulation, monitor.region, state, 0, 1);
  }
  return 0;
}

}  // namespace

std::vector<std::string> monitor_names(const Case& c) {
  std::vector<std::string> names;
  for (const Monitor& monitor : c.monitors) names.push_back(monitor.name);
  return names;
}

std::vector<double> monitor_values(const Case& c, const Formulation& formulation, const Equilibrium& state) {
  std::vector<double> values;
  for (const Monitor& monitor : c.monitors) values.push_back(value(c, formulation, state, monitor));
  return values;
}

}  // namespace femxdem
