#pragma once

#include <string>

#include "case.hpp"
#include "checkpoint.hpp"

namespace femxdem {

/// The hash that the checkpoint of a run must have for this case to go on from it: the checkpoint's own where the cases
/// differ by nothing but a control.end_time on which no load depends. Throws UserError that names the keys that differ.
std::string hash_of_restart(const CheckpointFile& checkpoint, const Case& c);

/// The parameters by which two texts of comparable_toml differ, one `key (theirs, now ours)` after another.
std::string differing_keys(const std::string& theirs, const std::string& ours);

}  // namespace femxdem
