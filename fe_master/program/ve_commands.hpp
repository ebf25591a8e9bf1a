#pragma once

#include <filesystem>
#include <string>

#include "time_loop.hpp"

namespace femxdem {

/// What the subcommands `femxdem ve ...` are asked for.
struct VeArguments {
  std::string file;                    ///< case file, or a prepared state (inspect)
  std::vector<std::string> overrides;  ///< section.key=value
  RunOptions options;                  ///< folder: where the results go, empty: the command's default
  int compare = 0;                     ///< prepare: DEM steps beside the scene's own continuation in YADE
  int noise_samples = 0;               ///< path: probes of the stress's jitter in each step
};

/// One material point along the case's path, see follow_path. Returns the exit status; throws UserError.
int ve_path(VeArguments arguments);

/// Makes the case's volume elements where the cache does not have them and prints their manifests.
int ve_prepare(const VeArguments& arguments);

/// Answers strains of the case's first volume element, see serve_volume_element.
int ve_serve(VeArguments arguments);

/// Draws packing, force chains and fabric rose of the case's first volume element, or of a prepared state, as PNG.
int ve_inspect(const VeArguments& arguments);

}  // namespace femxdem
