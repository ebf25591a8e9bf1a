#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "material_points.hpp"
#include "named_arrays.hpp"

namespace femxdem {

/// Everything that a run needs to go on from a converged step as if it had never stopped.
struct Checkpoint {
  int step = 0;                                 ///< the last converged step
  double time = 0;                              ///< [s]
  double dt = 0;                                ///< time increment that the next step would have tried [s]
  NamedArrays arrays;                           ///< master's committed state, in order, names unique
  SavedStates states;                           ///< committed states of the material points
  std::string case_text;                        ///< comparable_toml of the case
  std::map<std::string, std::string> versions;  ///< such as {"yade", "2023.02a"}; the states are readable by these only
};

/// Writes the checkpoint beside `file` and renames it: `file` is always a whole checkpoint, the old one or the new one.
/// Equal states (shared volume elements) are stored once.
void write_checkpoint(const std::filesystem::path& file, const Checkpoint& checkpoint);

/// Reads a checkpoint back, bit-equal. Throws UserError where there is none, or where it was written with other
/// versions than `versions` (of the names that both have).
Checkpoint read_checkpoint(const std::filesystem::path& file, const std::map<std::string, std::string>& versions);

}  // namespace femxdem
