#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "disk_file.hpp"
#include "folder_lock.hpp"

namespace femxdem {

/// What to do with the results that a folder already holds.
enum class Existing {
  refuse,     ///< UserError: nothing is overwritten unasked
  overwrite,  ///< the files of the earlier run are removed
  resume,     ///< a restart goes on with them
};

/// Makes the folder where it is missing, and its parents, and locks it for as long as the lock lives. Throws UserError
/// where it cannot be made or written, where another run writes into it, and where it holds results and `existing`
/// refuses them.
std::unique_ptr<FolderLock> prepare_output_folder(const std::filesystem::path& folder, Existing existing);

/// The bytes of a file; empty where there is none.
std::string read_file(const std::filesystem::path& file);

}  // namespace femxdem
