#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace femxdem {

/// Lengths of a data set along its axes, slowest first.
using Shape = std::vector<std::size_t>;

struct Hdf5Error : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// An HDF5 file, open as long as the object lives. A failure to read is an Hdf5Error that names file and data set, one
/// to write a DiskError with the system's reason; HDF5 does not survive a full disk, so space is reserved before. Paths
/// inside the file start with '/'; missing groups on the way are made. An update that does not come to finish() is
/// undone: at the end of the object or, where the process was killed, by the next update (undo_driver.hpp).
class Hdf5File {
 public:
  /// Gives back the memory that the library keeps for later use, with what it held.
  static void forget_memory();
  /// create truncates; read and update want an existing file
  enum class Mode { create, read, update };

  /// Opens without file locks: a reader such as ParaView must not stop a run that goes on writing.
  Hdf5File(const std::filesystem::path& file, Mode mode);
  ~Hdf5File();
  Hdf5File(const Hdf5File&) = delete;
  Hdf5File& operator=(const Hdf5File&) = delete;

  /// Makes sure that the file can grow by data sets of so many bytes in all, names and tables included.
  void reserve(std::uint64_t bytes, std::size_t data_sets);
  /// Puts everything with the system and closes; without it a failure to do so goes unnoticed.
  void finish();

  /// New data set of the given shape, row-major; values.size() is the product of the shape.
  void write(const std::string& path, std::span<const double> values, const Shape& shape);
  void write(const std::string& path, std::span<const int> values, const Shape& shape);
  /// New one-dimensional data set of bytes.
  void write_bytes(const std::string& path, std::string_view bytes);
  void make_group(const std::string& path);
  /// Removes a group or data set with everything below it.
  void remove(const std::string& path);

  /// Attribute of a group that exists ("/" is the file itself).
  void set_attribute(const std::string& group, const std::string& name, double value);
  void set_attribute(const std::string& group, const std::string& name, int value);
  void set_attribute(const std::string& group, const std::string& name, const std::string& value);

  std::vector<double> read(const std::string& path) const;
  std::string read_bytes(const std::string& path) const;
  Shape shape(const std::string& path) const;
  double number(const std::string& group, const std::string& name) const;
  std::string text(const std::string& group, const std::string& name) const;
  /// Names of a group's attributes.
  std::vector<std::string> attributes(const std::string& group) const;

  bool exists(const std::string& path) const;
  /// Names of the members of a group, sorted; empty where there is no such group.
  std::vector<std::string> members(const std::string& group) const;

 private:
  std::size_t count(const std::string& path, const Shape& lengths) const;
  [[noreturn]] void fail(std::string_view what, std::string_view path) const;
  void require_in_place() const;  ///< throws DiskError where there is no file of that name any more
  [[noreturn]] void fail_to_write(std::string_view what, std::string_view path);
  void write_raw(const std::string& path, const void* values, std::size_t count, const Shape& shape,
                 std::int64_t memory_type, std::int64_t file_type);
  void set_scalar(const std::string& group, const std::string& name, const void* value, std::int64_t type);

  std::filesystem::path file_;
  Mode mode_;
  std::int64_t id_ = -1;
  bool broken_ = false;  ///< a write failed: HDF5 must not touch the file again
};

}  // namespace femxdem
