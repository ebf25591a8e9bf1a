#include "output_folder.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string_view>
#include <system_error>
#include <vector>

#include "disk_file.hpp"
#include "errors.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

constexpr std::array kFilesOfARun = {
    "results.h5", "results.h5.undo", "results.xdmf",  "history.csv",       "summary.json",
    "log.txt",    "case.toml",       "checkpoint.h5", "checkpoint.h5.new", "checkpoint.previous.h5"};

void remove_results(const fs::path& folder) {
  for (const char* name : kFilesOfARun) fs::remove(folder / name);
}

/// Files that a run wrote beside its own (replace_file) when it was killed.
void remove_leftovers(const fs::path& folder) {
  std::vector<fs::path> leftovers;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    const bool beside = std::any_of(kFilesOfARun.begin(), kFilesOfARun.end(), [&](const std::string& file) {
      return name.size() == file.size() + kBeside.size() && name.starts_with(file + kBeside.front());
    });
    if (beside) leftovers.push_back(entry.path());
  }
  for (const fs::path& leftover : leftovers) fs::remove(leftover);
}

}  // namespace

std::unique_ptr<FolderLock> prepare_output_folder(const fs::path& folder, Existing existing) {
  std::error_code error, cannot_ask;
  fs::create_directories(folder, error);
  if (!fs::is_directory(folder, cannot_ask)) {
    throw UserError(fmt::format("{}: cannot be made a folder ({}); choose another --out", folder.string(),
                                error ? error.message() : "a file of that name exists"));
  }
  if (access(folder.c_str(), W_OK | X_OK) != 0) {
    throw UserError(fmt::format("{}: the folder cannot be written ({}); choose another --out", folder.string(),
                                std::strerror(errno)));
  }
  auto lock = std::make_unique<FolderLock>(folder);
  remove_leftovers(folder);
  if (existing == Existing::overwrite) remove_results(folder);
  const bool holds_results = fs::exists(folder / "history.csv") || fs::exists(folder / "results.h5");
  if (existing == Existing::refuse && holds_results) {
    throw UserError(
        fmt::format("{}: holds the results of an earlier run; go on with --restart, replace them with --overwrite or "
                    "choose another --out",
                    folder.string()));
  }
  return lock;
}

std::string read_file(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

}  // namespace femxdem
