#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>

namespace femxdem {

/// A file that text is appended to; every write is with the system when it returns. All throw DiskError with the
/// system's reason.
class AppendedFile {
 public:
  /// Without `keep` the file is emptied.
  AppendedFile(const std::filesystem::path& file, bool keep);
  ~AppendedFile();
  AppendedFile(const AppendedFile&) = delete;
  AppendedFile& operator=(const AppendedFile&) = delete;
  void write(std::string_view text);
  /// False when somebody has removed, replaced or shortened the file since.
  bool is_in_place() const;
  /// Goes on in the file of that name, a new one if there is none.
  void open_again();

 private:
  std::filesystem::path file_;
  int descriptor_;
  std::int64_t size_ = 0;  ///< of the file after the last write
};

/// What is said of a file that others have taken from a run.
inline constexpr std::string_view kTakenAway = "has been removed or changed since the run wrote it";

/// What replace_file adds to a name for the file beside it: mkostemp's pattern, which wants these six letters.
inline constexpr std::string_view kBeside = ".XXXXXX";

/// Writes beside `file`, makes sure of the disk and renames: a reader sees the old text or the new one, never half of
/// it, and the old one stays when the new one cannot be written.
void replace_file(const std::filesystem::path& file, std::string_view text);

/// Makes sure that `file`, which exists, can grow by so many bytes: for libraries that do not survive a full disk.
void reserve_space(const std::filesystem::path& file, std::uint64_t bytes);

/// `file` as it is now is called `other` as well, in place of what was called so; there is always a `file` (but for an
/// instant where the file system has no hard links). Nothing where there is no `file`.
void keep_as(const std::filesystem::path& file, const std::filesystem::path& other);

/// Puts `beside` in the place of `file`, once its bytes are on the disk.
void put_in_place(const std::filesystem::path& beside, const std::filesystem::path& file);

}  // namespace femxdem
