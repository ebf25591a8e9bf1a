#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "analytic_laws.hpp"
#include "case.hpp"
#include "double_stress.hpp"
#include "element.hpp"
#include "material_points.hpp"
#include "output_folder.hpp"
#include "summary.hpp"

namespace femxdem {

/// Exit status of the program.
enum ExitStatus : int {
  kDone = 0,
  kBadInput = 2,
  kNotConverged = 3,  ///< every converged step is on the disk
  kPointFailed = 4,   ///< a volume element failed and smaller steps did not help
  kNotWritten = 5,    ///< a file could not be written: disk full, quota
};

/// Where and how a case is run.
struct RunOptions {
  std::filesystem::path folder;
  Existing existing = Existing::refuse;  ///< resume: go on from checkpoint.h5 of the folder
  int ranks = 1;
  std::string command_line;
  std::map<std::string, std::string> versions;
  std::vector<std::string> remarks;  ///< on the material points, for log.txt: what was adopted, dropped, reset
  std::shared_ptr<FolderLock> lock;  ///< of the folder where it is prepared already
  std::function<void(Summary&)> complete = [](Summary&) {};  ///< adds what the farm knows
};

/// Finite elements of a case on its mesh.
std::unique_ptr<Element> make_element(const Case& c, const Mesh& mesh);

/// The law of the double stress of a second-gradient element.
DoubleStiffness make_double_stiffness(const ElementParameters& e);

/// The law in closed form of a case's material.
AnalyticLaw make_law(const MaterialParameters& m);

/// Material points of a case whose material is a law in closed form.
std::unique_ptr<MaterialPoints> make_analytic_points(const Case& c, const Mesh& mesh);

/// Runs the boundary value problem of a case on its material points, with all its files: results.h5, results.xdmf,
/// history.csv, summary.json, case.toml, log.txt, checkpoint.h5. Returns the exit status; throws UserError.
int run_simulation(const Case& c, const Mesh& mesh, MaterialPoints& points, const RunOptions& options);

}  // namespace femxdem
