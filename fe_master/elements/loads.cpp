#include "loads.hpp"

#include <algorithm>
#include <limits>

#include "edge_samples.hpp"

namespace femxdem {
namespace {

int component_index(Component component) {
  switch (component) {
    case Component::x:
    case Component::xx:
      return 0;
    case Component::y:
    case Component::xy:
      return 1;
    case Component::yx:
      return 2;
    case Component::yy:
      return 3;
    case Component::none:
      break;
  }
  return -1;
}

int nearest_node(const Mesh& mesh, const Point2& point) {
  int nearest = 0;
  double least = std::numeric_limits<double>::max();
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n) {
    const double distance = (mesh.nodes[n] - point).norm();
    if (distance < least) {
      least = distance;
      nearest = static_cast<int>(n);
    }
  }
  return nearest;
}

}  // namespace

double load_factor(const Load& load, double time, double end_time) {
  if (!load.table.empty()) {
    const auto later =
        std::find_if(load.table.begin(), load.table.end(), [time](const auto& row) { return row[0] > time; });
    if (later == load.table.begin()) return later->at(1);
    if (later == load.table.end()) return load.table.back()[1];
    const auto& [t0, f0] = *(later - 1);
    const auto& [t1, f1] = *later;
    return f0 + (f1 - f0) * (time - t0) / (t1 - t0);
  }
  switch (load.kind) {
    case LoadKind::displacement:
    case LoadKind::gradient:
      return time / end_time;
    case LoadKind::velocity:
      return time;
    case LoadKind::traction:
    case LoadKind::pressure:
      return 1.0;
  }
  return 1.0;
}

Loads::Loads(const Formulation& formulation, double end_time) : formulation_(formulation), end_time_(end_time) {}

void Loads::add(const Load& load) {
  if (load.kind == LoadKind::traction || load.kind == LoadKind::pressure) {
    forces_.push_back(load);
    return;
  }
  const Mesh& mesh = formulation_.mesh();
  const std::vector<int> nodes = load.point.empty()
                                     ? edge_nodes(mesh, load.edge)
                                     : std::vector<int>{nearest_node(mesh, Point2(load.point[0], load.point[1]))};
  const auto value = [load, end_time = end_time_](double t) { return load.value * load_factor(load, t, end_time); };
  for (const int node : nodes) {
    const int i = component_index(load.component);
    const int dof = load.kind == LoadKind::gradient ? formulation_.gradient_dof(node, i) : 2 * node + i;
    if (dof >= 0) prescribe(dof, value);
  }
}

void Loads::prescribe(int dof, std::function<double(double)> value) {
  const auto at = std::lower_bound(prescribed_.begin(), prescribed_.end(), dof,
                                   [](const Prescribed& p, int d) { return p.dof < d; });
  if (at != prescribed_.end() && at->dof == dof) {
    at->value = std::move(value);
  } else {
    prescribed_.insert(at, {dof, std::move(value)});
  }
}

std::vector<int> Loads::prescribed_dofs() const {
  std::vector<int> dofs;
  for (const Prescribed& p : prescribed_) dofs.push_back(p.dof);
  return dofs;
}

Eigen::VectorXd Loads::prescribed(double t_n, double t) const {
  const int displacements = 2 * static_cast<int>(formulation_.mesh().nodes.size());
  Eigen::VectorXd values(prescribed_.size());
  for (std::size_t i = 0; i < prescribed_.size(); ++i) {
    const auto& [dof, value] = prescribed_[i];
    values[static_cast<Eigen::Index>(i)] = dof < displacements ? value(t) : value(t) - value(t_n);
  }
  return values;
}

bool Loads::is_released(const Load& load) const {
  return std::find(released_.begin(), released_.end(), load.edge) != released_.end();
}

double Loads::released_factor(double t) const {
  for (const Load& load : forces_) {
    if (is_released(load)) return load_factor(load, t, end_time_);
  }
  return 0;
}

Eigen::VectorXd Loads::released_force(const Eigen::VectorXd& x) const {
  Eigen::VectorXd f = Eigen::VectorXd::Zero(formulation_.unknowns());
  for (const Load& load : forces_) {
    if (is_released(load)) add_edge_force(load, x, load.value, f);
  }
  return f;
}

Eigen::VectorXd Loads::external_force(const Eigen::VectorXd& x, double t) const {
  return external_force(x, t, released_factor(t));
}

Eigen::VectorXd Loads::external_force(const Eigen::VectorXd& x, double t, double released_factor) const {
  Eigen::VectorXd f = Eigen::VectorXd::Zero(formulation_.unknowns());
  for (const Load& load : forces_) {
    const double factor = is_released(load) ? released_factor : load_factor(load, t, end_time_);
    add_edge_force(load, x, load.value * factor, f);
  }
  if (body_force.x != 0 || body_force.y != 0) add_body_force(x, f);
  return f;
}

void Loads::add_body_force(const Eigen::VectorXd& x, Eigen::VectorXd& f) const {
  const std::vector<Tensor2> F = formulation_.deformation(x);
  for (std::size_t p = 0; p < formulation_.points(); ++p) {
    const PointShapes& s = formulation_.shapes(p);
    const double weight = s.weight * F[p].determinant();
    for (int a = 0; a < 8; ++a) {
      const int node = formulation_.mesh().elements[p / kPointsPerElement][a];
      f.segment<2>(2 * node) += weight * s.N8[a] * Point2(body_force.x, body_force.y);
    }
  }
}

/// Tractions act on the reference configuration, pressures on the current one.
void Loads::add_edge_force(const Load& load, const Eigen::VectorXd& x, double value, Eigen::VectorXd& f) const {
  const bool follows = load.kind == LoadKind::pressure;
  const Mesh& mesh = formulation_.mesh();
  for (const EdgeSample& g : follows ? edge_samples(mesh, load.edge, x) : edge_samples(mesh, load.edge)) {
    Point2 force = Point2::Zero();
    if (follows) {
      force = -value * outward_normal(g.tangent);
    } else {
      force[component_index(load.component)] = value * g.tangent.norm();
    }
    const double weight = g.weight * formulation_.thickness(g.position);
    for (int a = 0; a < 3; ++a) f.segment<2>(2 * g.nodes[a]) += weight * g.N[a] * force;
  }
}

std::vector<int> edge_nodes(const Mesh& mesh, const std::string& edge) {
  std::vector<int> nodes;
  for (const Side& side : mesh.edges.at(edge)) {
    for (const int node : side.nodes) {
      if (std::find(nodes.begin(), nodes.end(), node) == nodes.end()) nodes.push_back(node);
    }
  }
  return nodes;
}

}  // namespace femxdem
