#include "disk_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>
#include <system_error>

#include "errors.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& file, int reason) {
  throw DiskError(fmt::format("{}: cannot be written ({})", file.string(), std::strerror(reason)));
}

/// 0, or the system's reason.
int write_all(int descriptor, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = write(descriptor, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return written < 0 ? errno : ENOSPC;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return 0;
}

off_t size_of(int descriptor) {
  struct stat found {};
  return fstat(descriptor, &found) == 0 ? found.st_size : 0;
}

/// Writes zeros behind the file's end, where the file system reserves nothing; 0, or the system's reason.
int grow_by_zeros(int descriptor, off_t size, std::uint64_t bytes) {
  const std::string zeros(1 << 16, '\0');
  int reason = 0;
  for (std::uint64_t done = 0; done < bytes && reason == 0; done += zeros.size()) {
    const auto at = size + static_cast<off_t>(done);
    const ssize_t written = pwrite(descriptor, zeros.data(), zeros.size(), at);
    if (written < static_cast<ssize_t>(zeros.size())) reason = written < 0 ? errno : ENOSPC;
  }
  if (reason == 0) reason = fsync(descriptor) == 0 ? 0 : errno;
  if (reason != 0 && ftruncate(descriptor, size) != 0) return errno;
  return reason;
}

}  // namespace

AppendedFile::AppendedFile(const fs::path& file, bool keep)
    : file_(file),
      descriptor_(open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | (keep ? 0 : O_TRUNC), 0666)) {
  if (descriptor_ < 0) fail(file_, errno);
  size_ = size_of(descriptor_);
}

AppendedFile::~AppendedFile() { close(descriptor_); }

void AppendedFile::write(std::string_view text) {
  if (const int reason = write_all(descriptor_, text); reason != 0) fail(file_, reason);
  size_ = std::max(size_, size_of(descriptor_));
}

bool AppendedFile::is_in_place() const {
  struct stat named = {}, held = {};
  return stat(file_.c_str(), &named) == 0 && fstat(descriptor_, &held) == 0 && named.st_ino == held.st_ino &&
         named.st_dev == held.st_dev && held.st_size >= size_;
}

void AppendedFile::open_again() {
  const int descriptor = open(file_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (descriptor < 0) fail(file_, errno);
  close(descriptor_);
  descriptor_ = descriptor;
  size_ = size_of(descriptor_);
}

void replace_file(const fs::path& file, std::string_view text) {
  std::string beside = file.string();
  beside += kBeside;  // of this process: another one may write the same file of a cache
  const int descriptor = mkostemp(beside.data(), O_CLOEXEC);
  if (descriptor < 0) fail(file, errno);
  const mode_t mask = umask(0);
  umask(mask);
  fchmod(descriptor, 0666 & ~mask);
  int reason = write_all(descriptor, text);
  if (fsync(descriptor) != 0 && reason == 0) reason = errno;
  if (close(descriptor) != 0 && reason == 0) reason = errno;
  if (reason == 0 && rename(beside.c_str(), file.c_str()) != 0) reason = errno;
  if (reason == 0) return;
  unlink(beside.c_str());
  fail(file, reason);
}

void reserve_space(const fs::path& file, std::uint64_t bytes) {
  const int descriptor = open(file.c_str(), O_WRONLY | O_CLOEXEC);
  if (descriptor < 0) fail(file, errno);
  struct stat found {};
  int reason = fstat(descriptor, &found) == 0 ? 0 : errno;
  if (reason == 0 && fallocate(descriptor, FALLOC_FL_KEEP_SIZE, found.st_size, static_cast<off_t>(bytes)) != 0) {
    reason = errno == EOPNOTSUPP || errno == ENOSYS ? grow_by_zeros(descriptor, found.st_size, bytes) : errno;
  }
  close(descriptor);
  if (reason != 0) fail(file, reason);
}

void keep_as(const fs::path& file, const fs::path& other) {
  if (!fs::exists(file)) return;
  const std::string link_name = other.string() + ".new";
  unlink(link_name.c_str());
  if (link(file.c_str(), link_name.c_str()) != 0) {
    if (rename(file.c_str(), other.c_str()) != 0) fail(other, errno);
    return;
  }
  const int reason = rename(link_name.c_str(), other.c_str()) == 0 ? 0 : errno;
  unlink(link_name.c_str());  // rename leaves it where both are one file already
  if (reason != 0) fail(other, reason);
}

void put_in_place(const fs::path& beside, const fs::path& file) {
  const int descriptor = open(beside.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) fail(beside, errno);
  const int reason = fsync(descriptor) == 0 ? 0 : errno;
  close(descriptor);
  if (reason != 0) fail(beside, reason);
  if (rename(beside.c_str(), file.c_str()) != 0) fail(file, errno);
}

}  // namespace femxdem
