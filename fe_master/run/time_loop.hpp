#pragma once

#include "material_points.hpp"
#include "problem.hpp"
#include "run_files.hpp"

namespace femxdem {

/// Runs a boundary value problem on its material points, with all its files: results.h5, results.xdmf, history.csv,
/// summary.json, case.toml, log.txt, checkpoint.h5. Returns the exit status; throws UserError.
int run_case(Problem& problem, MaterialPoints& points, const RunOptions& options);

}  // namespace femxdem
