#include "hdf5_journal.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <hdf5.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <string>

#include "disk_file.hpp"
#include "errors.hpp"
#include "hash.hpp"
#include "packet.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;
using Place = std::uint64_t;

constexpr Place kPage = 4096;

fs::path journal_of(const fs::path& file) { return file.string() + ".journal"; }

/// 0, or the system's reason.
int write_at(int descriptor, const char* bytes, std::size_t size, Place at) {
  while (size > 0) {
    const ssize_t done = pwrite(descriptor, bytes, size, static_cast<off_t>(at));
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) return done < 0 ? errno : ENOSPC;
    bytes += done;
    at += static_cast<Place>(done);
    size -= static_cast<std::size_t>(done);
  }
  return 0;
}

/// Bytes behind the end of the file are zeros; false where it cannot be read.
bool read_at(int descriptor, char* bytes, std::size_t size, Place at) {
  while (size > 0) {
    const ssize_t done = pread(descriptor, bytes, size, static_cast<off_t>(at));
    if (done < 0 && errno == EINTR) continue;
    if (done < 0) return false;
    if (done == 0) break;
    bytes += done;
    at += static_cast<Place>(done);
    size -= static_cast<std::size_t>(done);
  }
  std::memset(bytes, 0, size);
  return true;
}

/// What is to be written over, by the start of its pages, and the size of the file after it.
struct Changes {
  std::map<Place, std::string> pages;
  Place size = 0;
};

std::string packed(const Changes& changes) {
  PacketWriter packet;
  packet.put(changes.size);
  packet.put(changes.pages.size());
  for (const auto& [at, bytes] : changes.pages) {
    packet.put(at);
    packet.put(std::string_view(bytes));
  }
  const std::string content = packet.take();
  PacketWriter checked;
  checked.put(hash(content));
  checked.put(std::string_view(content));
  return checked.take();
}

/// Throws std::out_of_range where the text is not whole.
Changes unpacked(const std::string& text) {
  PacketReader checked(text);
  const auto expected = checked.get<std::uint64_t>();
  const std::string content = checked.get_text();
  if (hash(content) != expected) throw std::out_of_range("journal: damaged");
  PacketReader packet(content);
  Changes changes;
  changes.size = packet.get<Place>();
  for (auto left = packet.get<std::size_t>(); left > 0; --left) {
    const Place at = packet.get<Place>();
    changes.pages[at] = packet.get_text();
  }
  return changes;
}

/// 0, or the system's reason. May be repeated.
int apply(const Changes& changes, int descriptor) {
  for (const auto& [at, bytes] : changes.pages)
    if (const int reason = write_at(descriptor, bytes.data(), bytes.size(), at); reason != 0) return reason;
  if (ftruncate(descriptor, static_cast<off_t>(changes.size)) != 0 || fsync(descriptor) != 0) return errno;
  return 0;
}

/// HDF5's file under this driver.
struct File : H5FD_t {
  fs::path name;
  int descriptor = -1;
  haddr_t end_of_addresses = 0, end_of_file = 0;
  Place old_size = 0;  ///< what lies before is written over at the close only
  Changes changes;
  bool truncated = false;  ///< to changes.size
};

File& own(H5FD_t* file) { return *static_cast<File*>(file); }
const File& own(const H5FD_t* file) { return *static_cast<const File*>(file); }

H5FD_t* open_file(const char* name, unsigned flags, hid_t, haddr_t) {
  const int descriptor = open(name, ((flags & H5F_ACC_RDWR) != 0 ? O_RDWR : O_RDONLY) | O_CLOEXEC);
  struct stat found {};
  if (descriptor < 0 || fstat(descriptor, &found) != 0) return nullptr;
  auto* file = new File{};
  file->name = name;
  file->descriptor = descriptor;
  file->old_size = file->end_of_file = static_cast<Place>(found.st_size);
  return file;
}

/// The update: to the disk what is new, to the journal what is written over, then into the file.
int update(File& file) {
  if (file.changes.pages.empty() && !file.truncated) return 0;
  if (!file.truncated) file.changes.size = file.end_of_file;
  if (fsync(file.descriptor) != 0) return errno;
  try {
    replace_file(journal_of(file.name), packed(file.changes));
  } catch (const DiskError&) {
    return errno != 0 ? errno : EIO;
  }
  if (const int reason = apply(file.changes, file.descriptor); reason != 0) return reason;
  return unlink(journal_of(file.name).c_str()) == 0 ? 0 : errno;
}

herr_t close_file(H5FD_t* closed) {
  File& file = own(closed);
  const int reason = update(file);
  close(file.descriptor);
  delete &file;
  errno = reason;
  return reason == 0 ? 0 : -1;
}

herr_t read_file(H5FD_t* from, H5FD_mem_t, hid_t, haddr_t at, std::size_t size, void* buffer) {
  const File& file = own(from);
  char* bytes = static_cast<char*>(buffer);
  if (!read_at(file.descriptor, bytes, size, at)) return -1;
  for (auto page = file.changes.pages.lower_bound(at / kPage * kPage); page != file.changes.pages.end(); ++page) {
    const Place start = std::max<Place>(page->first, at);
    const Place end = std::min<Place>(page->first + page->second.size(), at + size);
    if (page->first >= at + size) break;
    if (start < end) std::memcpy(bytes + (start - at), page->second.data() + (start - page->first), end - start);
  }
  return 0;
}

/// The page that starts at `at`, as it is by now; it ends where the old file did.
std::string* page_of(File& file, Place at) {
  const auto [entry, is_new] = file.changes.pages.try_emplace(at);
  if (is_new) {
    entry->second.resize(std::min(kPage, file.old_size - at));
    if (!read_at(file.descriptor, entry->second.data(), entry->second.size(), at)) return nullptr;
  }
  return &entry->second;
}

herr_t write_file(H5FD_t* to, H5FD_mem_t, hid_t, haddr_t at, std::size_t size, const void* buffer) {
  File& file = own(to);
  const char* bytes = static_cast<const char*>(buffer);
  const Place end = at + size;
  for (Place place = at; place < std::min<Place>(end, file.old_size);) {
    const Place start = place / kPage * kPage;
    std::string* page = page_of(file, start);
    if (page == nullptr) return -1;
    const Place here = std::min<Place>(start + page->size(), end);
    std::memcpy(page->data() + (place - start), bytes + (place - at), here - place);
    place = here;
  }
  if (end > file.old_size) {
    const Place start = std::max<Place>(at, file.old_size);
    const int reason = write_at(file.descriptor, bytes + (start - at), end - start, start);
    errno = reason;
    if (reason != 0) return -1;
  }
  file.end_of_file = std::max(file.end_of_file, end);
  return 0;
}

herr_t truncate_file(H5FD_t* truncated, hid_t, hbool_t) {
  File& file = own(truncated);
  if (file.end_of_addresses == file.end_of_file) return 0;
  file.end_of_file = file.changes.size = file.end_of_addresses;
  file.truncated = true;
  return 0;
}

H5FD_class_t driver() {
  H5FD_class_t made{};
  made.name = "femxdem_journal";
  made.maxaddr = (haddr_t{1} << 62) - 1;
  made.fc_degree = H5F_CLOSE_WEAK;
  made.open = open_file;
  made.close = close_file;
  made.cmp = [](const H5FD_t* a, const H5FD_t* b) { return a < b ? -1 : a == b ? 0 : 1; };
  made.query = [](const H5FD_t*, unsigned long* flags) -> herr_t {
    *flags = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DATA_SIEVE |
             H5FD_FEAT_AGGREGATE_SMALLDATA | H5FD_FEAT_DEFAULT_VFD_COMPATIBLE;
    return 0;
  };
  made.get_eoa = [](const H5FD_t* file, H5FD_mem_t) { return own(file).end_of_addresses; };
  made.set_eoa = [](H5FD_t* file, H5FD_mem_t, haddr_t to) -> herr_t {
    own(file).end_of_addresses = to;
    return 0;
  };
  made.get_eof = [](const H5FD_t* file, H5FD_mem_t) { return own(file).end_of_file; };
  made.read = read_file;
  made.write = write_file;
  made.truncate = truncate_file;
  const H5FD_mem_t map[H5FD_MEM_NTYPES] = H5FD_FLMAP_DICHOTOMY;
  std::copy(std::begin(map), std::end(map), std::begin(made.fl_map));
  return made;
}

}  // namespace

bool journal_updates(std::int64_t access_list) {
  static const H5FD_class_t made = driver();
  static const hid_t registered = H5FDregister(&made);
  return registered >= 0 && H5Pset_driver(access_list, registered, nullptr) >= 0;
}

void finish_update(const fs::path& file) {
  const fs::path journal = journal_of(file);
  std::ifstream stream(journal, std::ios::binary);
  if (!stream) return;
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  int reason = 0;
  try {
    const Changes changes = unpacked(text);
    const int descriptor = open(file.c_str(), O_RDWR | O_CLOEXEC);
    reason = descriptor < 0 ? errno : apply(changes, descriptor);
    if (descriptor >= 0) close(descriptor);
  } catch (const std::out_of_range&) {  // it was never whole: the file is the old one
  }
  if (reason != 0)
    throw DiskError(fmt::format("{}: its last update cannot be finished ({})", file.string(), std::strerror(reason)));
  forget_update(file);
}

void forget_update(const fs::path& file) {
  std::error_code ignored;
  fs::remove(journal_of(file), ignored);
}

}  // namespace femxdem
