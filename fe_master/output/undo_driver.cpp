#include "undo_driver.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <hdf5.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "errors.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

/// The undo file: the old file's size, then a Piece and its bytes for each that was overwritten, in that order.
struct Piece {
  std::uint64_t at = 0, size = 0;
};

/// POSIX's driver, H5FD_SEC2, and what it overwrites.
struct Driver {
  H5FD_t seen;  // by HDF5
  H5FD_t* file = nullptr;
  int old_bytes = -1, undo = -1;  // descriptors
  haddr_t old_size = 0;           // of what is not kept yet

  ~Driver() {
    if (old_bytes >= 0) close(old_bytes);
    if (undo >= 0) close(undo);
  }
};

Driver& of(H5FD_t* seen) { return *reinterpret_cast<Driver*>(seen); }
const Driver& of(const H5FD_t* seen) { return *reinterpret_cast<const Driver*>(seen); }

bool append(int descriptor, std::string_view bytes) {
  const ssize_t written = write(descriptor, bytes.data(), bytes.size());
  if (written >= 0 && written < static_cast<ssize_t>(bytes.size())) errno = ENOSPC;
  return written == static_cast<ssize_t>(bytes.size());
}

/// In one write: a piece that is not whole has not been overwritten.
bool keep(Driver& driver, haddr_t at, haddr_t end) {
  end = std::min(end, driver.old_size);
  if (at >= end) return true;
  const Piece piece{at, end - at};
  std::string bytes(sizeof piece + piece.size, '\0');
  std::memcpy(bytes.data(), &piece, sizeof piece);
  if (pread(driver.old_bytes, bytes.data() + sizeof piece, piece.size, static_cast<off_t>(at)) !=
      static_cast<ssize_t>(piece.size))
    return false;
  return append(driver.undo, bytes);
}

H5FD_t* open_file(const char* name, unsigned flags, hid_t, haddr_t max) {
  auto* driver = new Driver();
  struct stat found {};
  driver->old_bytes = open(name, O_RDONLY | O_CLOEXEC);
  driver->undo = open(undo_file(name).c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0666);
  if (driver->old_bytes >= 0 && driver->undo >= 0 && fstat(driver->old_bytes, &found) == 0) {
    driver->old_size = static_cast<haddr_t>(found.st_size);
    const std::uint64_t size = driver->old_size;
    if (append(driver->undo, {reinterpret_cast<const char*>(&size), sizeof size}))
      driver->file = H5FDopen(name, flags, H5P_DEFAULT, max);
  }
  if (driver->file != nullptr) return &driver->seen;
  delete driver;
  return nullptr;
}

herr_t close_file(H5FD_t* seen) {
  const herr_t status = H5FDclose(of(seen).file);
  delete &of(seen);
  return status;
}

herr_t write_file(H5FD_t* seen, H5FD_mem_t type, hid_t list, haddr_t at, std::size_t size, const void* bytes) {
  if (!keep(of(seen), at, at + size)) return -1;
  return H5FDwrite(of(seen).file, type, list, at, size, bytes);
}

herr_t truncate_file(H5FD_t* seen, hid_t list, hbool_t closing) {
  const haddr_t end = H5FDget_eoa(of(seen).file, H5FD_MEM_DEFAULT);
  if (!keep(of(seen), end, HADDR_MAX)) return -1;
  of(seen).old_size = std::min(of(seen).old_size, end);  // what was behind it is kept
  return H5FDtruncate(of(seen).file, list, closing);
}

H5FD_class_t driver_class() {
  H5FD_class_t c{};
  c.name = "femxdem_undo";
  c.maxaddr = static_cast<haddr_t>(std::numeric_limits<off_t>::max());
  c.fc_degree = H5F_CLOSE_WEAK;
  c.open = open_file;
  c.close = close_file;
  c.cmp = [](const H5FD_t* a, const H5FD_t* b) { return H5FDcmp(of(a).file, of(b).file); };
  c.query = [](const H5FD_t*, unsigned long* flags) {
    *flags = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DATA_SIEVE |
             H5FD_FEAT_AGGREGATE_SMALLDATA | H5FD_FEAT_DEFAULT_VFD_COMPATIBLE;
    return herr_t{0};
  };
  c.get_eoa = [](const H5FD_t* f, H5FD_mem_t type) { return H5FDget_eoa(of(f).file, type); };
  c.set_eoa = [](H5FD_t* f, H5FD_mem_t type, haddr_t end) { return H5FDset_eoa(of(f).file, type, end); };
  c.get_eof = [](const H5FD_t* f, H5FD_mem_t type) { return H5FDget_eof(of(f).file, type); };
  c.read = [](H5FD_t* f, H5FD_mem_t type, hid_t list, haddr_t at, std::size_t size, void* bytes) {
    return H5FDread(of(f).file, type, list, at, size, bytes);
  };
  c.write = write_file;
  c.flush = [](H5FD_t* f, hid_t list, hbool_t closing) { return H5FDflush(of(f).file, list, closing); };
  c.truncate = truncate_file;
  const H5FD_mem_t as_posix[] = H5FD_FLMAP_DICHOTOMY;
  std::copy(std::begin(as_posix), std::end(as_posix), c.fl_map);
  return c;
}

[[noreturn]] void fail(const fs::path& file) {
  throw DiskError(fmt::format("{}: cannot be put back as it was before an unfinished update ({})", file.string(),
                              std::strerror(errno)));
}

std::string contents(const fs::path& file) {
  std::string bytes(fs::file_size(file), '\0');
  const int descriptor = open(file.c_str(), O_RDONLY | O_CLOEXEC);
  const ssize_t got = descriptor < 0 ? -1 : read(descriptor, bytes.data(), bytes.size());
  if (descriptor >= 0) close(descriptor);
  if (got != static_cast<ssize_t>(bytes.size())) fail(file);
  return bytes;
}

/// Places of the whole pieces in the undo file.
std::vector<std::pair<Piece, const char*>> pieces_of(const std::string& undo) {
  std::vector<std::pair<Piece, const char*>> pieces;
  for (std::size_t at = sizeof(std::uint64_t); at + sizeof(Piece) <= undo.size();) {
    Piece piece;
    std::memcpy(&piece, undo.data() + at, sizeof piece);
    at += sizeof piece;
    if (piece.size > undo.size() - at) break;
    pieces.emplace_back(piece, undo.data() + at);
    at += piece.size;
  }
  return pieces;
}

}  // namespace

std::int64_t undo_driver() {
  static const H5FD_class_t driver = driver_class();
  static const hid_t id = H5FDregister(&driver);
  return id;
}

fs::path undo_file(const fs::path& file) { return file.string() + ".undo"; }

void undo_unfinished_update(const fs::path& file) {
  const fs::path kept = undo_file(file);
  if (!fs::exists(kept)) return;
  const std::string undo = contents(kept);
  std::uint64_t size = 0;
  if (undo.size() >= sizeof size) {  // else nothing has been written yet
    std::memcpy(&size, undo.data(), sizeof size);
    auto pieces = pieces_of(undo);
    std::reverse(pieces.begin(), pieces.end());
    const int descriptor = open(file.c_str(), O_WRONLY | O_CLOEXEC);
    bool done = descriptor >= 0;
    for (const auto& [piece, bytes] : pieces)
      done = done &&
             pwrite(descriptor, bytes, piece.size, static_cast<off_t>(piece.at)) == static_cast<ssize_t>(piece.size);
    done = done && ftruncate(descriptor, static_cast<off_t>(size)) == 0;
    if (descriptor >= 0) close(descriptor);
    if (!done) fail(file);
  }
  fs::remove(kept);
}

}  // namespace femxdem
