#pragma once

#include <filesystem>
#include <memory>

#include "case.hpp"
#include "checkpoint.hpp"
#include "run_files.hpp"

namespace femxdem {

/// The checkpoint that a run goes on from, and its file, which holds the states of the points.
struct Resumed {
  std::unique_ptr<CheckpointFile> file;
  Checkpoint checkpoint;
};

/// That of the run's folder; nothing where the run does not resume. Throws UserError where it cannot go on from it.
Resumed resumed_from(const RunOptions& options, const Case& c);

/// Throws UserError that names the keys that differ where this case cannot go on from what `file` holds: where it
/// differs from the case that wrote it by more than a control.end_time on which no load depends.
void refuse_other_case(const std::filesystem::path& file, const Checkpoint& checkpoint, const Case& c);

}  // namespace femxdem
