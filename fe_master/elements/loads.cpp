#include "loads.hpp"

#include <algorithm>
#include <limits>

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

Loads::Loads(const Element& element, double end_time) : element_(element), end_time_(end_time) {}

void Loads::add(const Load& load) {
  if (load.kind == LoadKind::traction || load.kind == LoadKind::pressure) {
    forces_.push_back(load);
    return;
  }
  const Mesh& mesh = element_.mesh();
  const std::vector<int> nodes = load.point.empty()
                                     ? edge_nodes(mesh, load.edge)
                                     : std::vector<int>{nearest_node(mesh, Point2(load.point[0], load.point[1]))};
  const auto value = [load, end_time = end_time_](double t) { return load.value * load_factor(load, t, end_time); };
  for (const int node : nodes) {
    const int i = component_index(load.component);
    const int dof = load.kind == LoadKind::gradient ? element_.gradient_dof(node, i) : 2 * node + i;
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
  const int displacements = 2 * static_cast<int>(element_.mesh().nodes.size());
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
  Eigen::VectorXd f = Eigen::VectorXd::Zero(element_.unknowns());
  for (const Load& load : forces_) {
    if (is_released(load)) add_edge_force(load, x, load.value, f);
  }
  return f;
}

Eigen::VectorXd Loads::external_force(const Eigen::VectorXd& x, double t) const {
  return external_force(x, t, released_factor(t));
}

Eigen::VectorXd Loads::external_force(const Eigen::VectorXd& x, double t, double released_factor) const {
  Eigen::VectorXd f = Eigen::VectorXd::Zero(element_.unknowns());
  for (const Load& load : forces_) {
    const double factor = is_released(load) ? released_factor : load_factor(load, t, end_time_);
    add_edge_force(load, x, load.value * factor, f);
  }
  if (body_force.x == 0 && body_force.y == 0) return f;
  const std::vector<Tensor2> F = element_.deformation(x);
  for (std::size_t p = 0; p < element_.points(); ++p) {
    const QuadraturePoint& g = gauss_2x2()[p % kPointsPerElement];
    const Shape8 N = shape_q8(g.xi, g.eta);
    const double weight = element_.shapes(p).weight * F[p].determinant();
    for (int a = 0; a < 8; ++a) {
      const int node = element_.mesh().elements[p / kPointsPerElement][a];
      f.segment<2>(2 * node) += weight * N[a] * Point2(body_force.x, body_force.y);
    }
  }
  return f;
}

void Loads::add_edge_force(const Load& load, const Eigen::VectorXd& x, double value, Eigen::VectorXd& f) const {
  const Mesh& mesh = element_.mesh();
  for (const Side& side : mesh.edges.at(load.edge)) {
    for (const EdgePoint& g : gauss_edge()) {
      const Eigen::Vector3d N = shape_edge(g.s), dN = shape_gradient_edge(g.s);
      Point2 tangent = Point2::Zero();  // d(position)/ds, reference for tractions, current for pressures
      for (int a = 0; a < 3; ++a) {
        const int node = side.nodes[a];
        tangent += dN[a] * mesh.nodes[node];
        if (load.kind == LoadKind::pressure) tangent += dN[a] * x.segment<2>(2 * node);
      }
      Point2 force = Point2::Zero();
      if (load.kind == LoadKind::pressure) {
        force = -value * Point2(tangent.y(), -tangent.x());  // outward normal times length: material on the left
      } else {
        force[component_index(load.component)] = value * tangent.norm();
      }
      for (int a = 0; a < 3; ++a) f.segment<2>(2 * side.nodes[a]) += g.weight * N[a] * force;
    }
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
