#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace femxdem {

/// What to do with the results that a folder already holds.
enum class Existing {
  refuse,     ///< UserError: nothing is overwritten unasked
  overwrite,  ///< the files of the earlier run are removed
  resume,     ///< a restart goes on with them
};

/// Makes the folder where it is missing, and its parents. Throws UserError where it cannot be made or written, and
/// where it holds results and `existing` refuses them.
void prepare_output_folder(const std::filesystem::path& folder, Existing existing);

/// The bytes of a file; empty where there is none.
std::string read_file(const std::filesystem::path& file);

/// Writes beside `file` and renames: a reader sees the old text or the new one, never half of it.
void replace_file(const std::filesystem::path& file, std::string_view text);

}  // namespace femxdem
