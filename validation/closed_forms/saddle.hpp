#pragma once

#include "assembler.hpp"

namespace femxdem {

/// Matrices of the second gradient about the reference configuration, law with one parameter, a rectangle of W x 2 W
/// with its lower and upper edge guided.
struct MixedProblem {
  MixedProblem(int nx, int ny, double D);

  /// Matrix of u and v with penalty r [Pa] (symmetric positive definite for r > 0).
  SparseMatrix augmented(double r) const;
  /// Matrix of u, v and lambda, the multiplier counted in units of `scale` [Pa] (symmetric indefinite).
  SparseMatrix saddle(double scale) const;

  Mesh mesh;
  Tensor4 C;
  double D;
  std::vector<int> prescribed;
};

}  // namespace femxdem
