#include "edge_samples.hpp"

#include "reference_element.hpp"

namespace femxdem {
namespace {

std::vector<EdgeSample> samples(const Mesh& mesh, const std::string& edge, const Eigen::VectorXd* x) {
  std::vector<EdgeSample> all;
  for (const Side& side : mesh.edges.at(edge)) {
    for (const EdgePoint& g : gauss_edge()) {
      EdgeSample sample{side.nodes, shape_edge(g.s), shape_gradient_edge(g.s),
                        g.weight,   Point2::Zero(),  Point2::Zero()};
      for (int a = 0; a < 3; ++a) {
        const int node = side.nodes[a];
        sample.position += sample.N[a] * mesh.nodes[node];
        sample.tangent += sample.dN[a] * mesh.nodes[node];
        if (x == nullptr) continue;
        sample.position += sample.N[a] * x->segment<2>(2 * node);
        sample.tangent += sample.dN[a] * x->segment<2>(2 * node);
      }
      all.push_back(sample);
    }
  }
  return all;
}

}  // namespace

std::vector<EdgeSample> edge_samples(const Mesh& mesh, const std::string& edge) { return samples(mesh, edge, nullptr); }

std::vector<EdgeSample> edge_samples(const Mesh& mesh, const std::string& edge, const Eigen::VectorXd& x) {
  return samples(mesh, edge, &x);
}

}  // namespace femxdem
