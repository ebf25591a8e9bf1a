#include "folder_lock.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>
#include <system_error>
#include <vector>

#include "errors.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

/// Who holds a lock: four words.
struct Owner {
  std::string host, boot;
  long process = 0;
  std::string start;  ///< of the process, clock ticks since boot: its number may be given again
  bool operator==(const Owner&) const = default;
};

std::string first_word(const fs::path& file) {
  std::string word;
  std::ifstream(file) >> word;
  return word;
}

/// Field 22 of /proc/PID/stat; empty when there is no such process, or only its remains.
std::string start_of(long process) {
  std::ifstream stream(fmt::format("/proc/{}/stat", process));
  std::string text, word, state;
  std::getline(stream, text);
  const std::size_t after_name = text.rfind(')');
  if (after_name == std::string::npos) return {};
  std::istringstream fields(text.substr(after_name + 1));
  fields >> state;
  if (state == "Z" || state == "X") return {};
  for (int field = 4; field <= 22; ++field) fields >> word;
  return word;
}

Owner myself() {
  std::array<char, 256> host{};
  gethostname(host.data(), host.size() - 1);
  return {host.data(), first_word("/proc/sys/kernel/random/boot_id"), getpid(), start_of(getpid())};
}

Owner read_owner(const fs::path& file) {
  Owner owner;
  std::ifstream(file) >> owner.host >> owner.boot >> owner.process >> owner.start;
  return owner;
}

bool is_over(const Owner& owner) {
  if (owner.boot != myself().boot) return true;
  const std::string start = start_of(owner.process);
  return start.empty() || start != owner.start;
}

/// Where a process writes its lock before it appears, and where it puts one that it takes over.
fs::path beside_of(const fs::path& file, long process) { return fmt::format("{}.{}", file.string(), process); }

/// What processes that were killed have left there.
void remove_leftovers(const fs::path& file) {
  const std::string prefix = file.filename().string() + ".";
  std::vector<fs::path> leftovers;
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(file.parent_path(), ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(prefix) && start_of(std::atol(name.c_str() + prefix.size())).empty())
      leftovers.push_back(entry.path());
  }
  for (const fs::path& leftover : leftovers) fs::remove(leftover, ignored);
}

/// Creates the lock; false when there is one. It appears with its text: it is written beside and linked.
bool create(const fs::path& file, const Owner& owner) {
  const fs::path beside = beside_of(file, owner.process);
  const int descriptor = open(beside.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  const std::string text = fmt::format("{} {} {} {}\n", owner.host, owner.boot, owner.process, owner.start);
  const bool written =
      descriptor >= 0 && write(descriptor, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  int reason = errno;
  if (descriptor >= 0) close(descriptor);
  const bool linked = written && link(beside.c_str(), file.c_str()) == 0;
  if (written && !linked) reason = errno;
  unlink(beside.c_str());
  if (linked) return true;
  if (written && reason == EEXIST) return false;
  throw DiskError(fmt::format("{}: cannot be written ({})", file.string(), std::strerror(reason)));
}

/// The lock of this process, for a handler of signals: it may only call what is safe there.
std::array<char, 4096> held_file{};

}  // namespace

FolderLock::FolderLock(const fs::path& folder) : file_(fs::absolute(folder) / "running.lock") {
  const Owner me = myself();
  while (!create(file_, me)) {
    const Owner other = read_owner(file_);
    const bool foreign = other.host != me.host;
    if (foreign || !is_over(other)) {
      const std::string who =
          other.host.empty() ? "another run" : fmt::format("process {} on {}", other.process, other.host);
      throw UserError(
          foreign ? fmt::format("{}: {} writes into this folder, as {} says, and cannot be asked from this host; "
                                "if that run has ended, remove that file, else choose another --out",
                                folder.string(), who, file_.string())
                  : fmt::format("{}: {} writes into this folder; wait until it ends or choose another --out",
                                folder.string(), who));
    }
    remark_ =
        fmt::format("{}: taken over from process {}, which ended without leaving it", folder.string(), other.process);
    const fs::path mine = beside_of(file_, me.process);
    std::error_code moved;
    fs::rename(file_, mine, moved);  // of two that take over, one moves it
    if (!moved) fs::remove(mine, moved);
  }
  remove_leftovers(file_);
  if (file_.string().size() < held_file.size()) std::strcpy(held_file.data(), file_.c_str());
}

FolderLock::~FolderLock() {
  held_file[0] = '\0';
  std::error_code ignored;
  fs::remove(file_, ignored);
}

void let_go_of_lock() {
  if (held_file[0] != '\0') unlink(held_file.data());
}

}  // namespace femxdem
