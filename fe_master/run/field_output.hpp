#pragma once

#include <vector>

#include "problem.hpp"
#include "results.hpp"

namespace femxdem {

/// Reference positions of the Gauss points [m], element by element.
std::vector<Point2> point_positions(const Formulation& formulation);

/// Fields of a problem's committed state: stress, strain and report of every point, second-order work of the step from
/// `before`, least tangent eigenvalue and acoustic determinant, residuals, displacements and the formulation's own.
FieldStep field_step(int step, double end_time, const Problem& problem, const Equilibrium& before);

}  // namespace femxdem
