#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>

#include "errors.hpp"
#include "material_points.hpp"
#include "output_folder.hpp"
#include "problem.hpp"
#include "summary.hpp"

namespace femxdem {

/// Where and how a case is run.
struct RunOptions {
  std::filesystem::path folder;
  Existing existing = Existing::refuse;  ///< resume: go on from checkpoint.h5 of the folder
  int ranks = 1;
  std::string command_line;
  std::map<std::string, std::string> versions;
  std::function<void(Summary&)> complete = [](Summary&) {};  ///< adds what the farm knows
};

/// Runs the boundary value problem of a case on its material points, with all its files: results.h5, results.xdmf,
/// history.csv, summary.json, case.toml, log.txt, checkpoint.h5. Returns the exit status; throws UserError.
int run_case(Problem& problem, MaterialPoints& points, const RunOptions& options);

}  // namespace femxdem
