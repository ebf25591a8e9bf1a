#include "output_folder.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <system_error>

#include "errors.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

constexpr std::array kFilesOfARun = {"results.h5", "results.xdmf", "history.csv",   "summary.json",
                                     "log.txt",    "case.toml",    "checkpoint.h5", "checkpoint.h5.new"};

void remove_results(const fs::path& folder) {
  for (const char* name : kFilesOfARun) fs::remove(folder / name);
}

}  // namespace

void prepare_output_folder(const fs::path& folder, Existing existing) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!fs::is_directory(folder)) {
    throw UserError(fmt::format("{}: cannot be made a folder ({}); choose another --out", folder.string(),
                                error ? error.message() : "a file of that name exists"));
  }
  if (access(folder.c_str(), W_OK | X_OK) != 0) {
    throw UserError(fmt::format("{}: the folder cannot be written; choose another --out", folder.string()));
  }
  if (existing == Existing::overwrite) remove_results(folder);
  const bool holds_results = fs::exists(folder / "history.csv") || fs::exists(folder / "results.h5");
  if (existing == Existing::refuse && holds_results) {
    throw UserError(
        fmt::format("{}: holds the results of an earlier run; go on with --restart, replace them with --overwrite or "
                    "choose another --out",
                    folder.string()));
  }
}

std::string read_file(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

void replace_file(const fs::path& file, std::string_view text) {
  fs::path beside = file;
  beside += ".new";
  std::ofstream stream(beside, std::ios::binary);
  stream << text;
  stream.close();
  if (!stream) throw std::runtime_error(fmt::format("{}: cannot be written; is the disk full?", beside.string()));
  fs::rename(beside, file);
}

}  // namespace femxdem
