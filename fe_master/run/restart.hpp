#pragma once

#include <filesystem>

#include "case.hpp"
#include "checkpoint.hpp"

namespace femxdem {

/// Throws UserError that names the keys that differ where this case cannot go on from what `file` holds: where it
/// differs from the case that wrote it by more than a control.end_time on which no load depends.
void refuse_other_case(const std::filesystem::path& file, const Checkpoint& checkpoint, const Case& c);

}  // namespace femxdem
