#pragma once

#include <cstdint>
#include <filesystem>

namespace femxdem {

/// HDF5's identifier of a file driver for updates: before a byte of the old file is overwritten or cut off, it goes
/// into undo_file(), so that a process that is killed in the midst of an update leaves what undoes it.
std::int64_t undo_driver();

/// results.h5 -> results.h5.undo: there as long as an update is not whole.
std::filesystem::path undo_file(const std::filesystem::path& file);

/// The file as it was before an update that was not finished, if there was one. Throws DiskError.
void undo_unfinished_update(const std::filesystem::path& file);

}  // namespace femxdem
