#pragma once

#include "arguments.hpp"

namespace femxdem {

/// One material point along the case's path, see follow_path. Returns the exit status; throws UserError.
int ve_path(const Arguments& arguments);

/// Makes the case's volume elements where the cache does not have them and prints their manifests.
int ve_prepare(const Arguments& arguments);

/// Answers strains of the case's first volume element, see serve_volume_element.
int ve_serve(const Arguments& arguments);

/// Draws packing, force chains and fabric rose of the case's first volume element, or of a prepared state, as PNG.
int ve_inspect(const Arguments& arguments);

}  // namespace femxdem
