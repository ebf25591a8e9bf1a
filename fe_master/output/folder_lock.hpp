#pragma once

#include <filesystem>
#include <string>

namespace femxdem {

/// A folder of results belongs to one run at a time: the file running.lock in it names host, boot, process and its
/// start.
///
/// The lock of a process of this host that has ended (killed, or of before a reboot) is taken over; `remark` then says
/// so. Throws UserError while the other run lives, or where it is of another host and cannot be asked. The file goes
/// with this object, or with let_go_of_lock().
class FolderLock {
 public:
  explicit FolderLock(const std::filesystem::path& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

  const std::string& remark() const { return remark_; }

 private:
  std::filesystem::path file_;
  std::string remark_;
};

/// Removes the lock of this process, if it holds one. Safe in a handler of signals.
void let_go_of_lock();

}  // namespace femxdem
