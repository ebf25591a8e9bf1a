#pragma once

#include <cstdint>
#include <filesystem>

namespace femxdem {

/// Makes the HDF5 files that are opened with this access list (of H5P_FILE_ACCESS) for an update safe against an end at any
/// moment. What lies behind the old end of the file is written at once; what would be written over is kept in memory, and
/// at the close of the file goes into FILE.journal, then into the file, then the journal is removed. So a reader finds
/// the old file, or a journal from which the new one can be made: finish_update. False where HDF5 refuses.
bool journal_updates(std::int64_t access_list);

/// Finishes the update that an earlier process had begun to write into `file`, if there is one; half a journal is none.
/// Throws DiskError where the file cannot be written.
void finish_update(const std::filesystem::path& file);

/// Removes that update: the file is to be made anew.
void forget_update(const std::filesystem::path& file);

}  // namespace femxdem
