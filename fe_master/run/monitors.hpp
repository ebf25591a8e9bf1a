#pragma once

#include <string>
#include <vector>

#include "case.hpp"
#include "nonlinear_solver.hpp"

namespace femxdem {

/// Names of the monitor columns of history.csv, in the order of the case.
std::vector<std::string> monitor_names(const Case& c);

/// Their values in a state of equilibrium: reactions (in plane strain per thickness [N/m], axisymmetric of
/// the full circumference [N]), mean displacements [m], lengths [m], pressures [Pa],
/// volume means of the Cauchy stress [Pa].
std::vector<double> monitor_values(const Case& c, const Formulation& formulation, const Equilibrium& state);

}  // namespace femxdem
