#pragma once

#include <string>

#include "edge_samples.hpp"

namespace femxdem {

/// Length of a named edge along its quadratic sides [m].
inline double edge_length(const Mesh& mesh, const std::string& edge) {
  double length = 0;
  for (const EdgeSample& g : edge_samples(mesh, edge)) length += g.weight * g.tangent.norm();
  return length;
}

}  // namespace femxdem
