#include "hdf5_file.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <functional>
#include <numeric>
#include <system_error>
#include <utility>

#include "disk_file.hpp"
#include "errors.hpp"
#include "undo_driver.hpp"

namespace femxdem {
namespace {

/// An HDF5 identifier that is closed at the end of its scope.
class Handle {
 public:
  using Close = herr_t (*)(hid_t);
  Handle(hid_t id, Close close) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }

 private:
  hid_t id_;
  Close close_;
};

hid_t creation_of_missing_groups() {
  const hid_t list = H5Pcreate(H5P_LINK_CREATE);
  H5Pset_create_intermediate_group(list, 1);
  return list;
}

hid_t string_type(std::size_t length) {
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, std::max<std::size_t>(length, 1));
  H5Tset_cset(type, H5T_CSET_UTF8);
  return type;
}

/// Whether there is such an attribute, of one value.
bool is_single(hid_t attribute) {
  if (attribute < 0) return false;
  const Handle space(H5Aget_space(attribute), H5Sclose);
  return space >= 0 && H5Sget_simple_extent_npoints(space) == 1;
}

}  // namespace

void Hdf5File::forget_memory() { H5garbage_collect(); }

Hdf5File::Hdf5File(const std::filesystem::path& file, Mode mode) : file_(file), mode_(mode) {
  H5dont_atexit();  // at the end of the program it would write again what could not be written
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // failures are exceptions, not text on stderr
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_file_locking(access, false, true);
  const std::string name = file.string();
  if (mode == Mode::update) {
    undo_unfinished_update(file);
    H5Pset_driver(access, undo_driver(), nullptr);
  }
  if (mode == Mode::create) {
    std::filesystem::remove(undo_file(file));
    id_ = H5Fcreate(name.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access);
  } else {
    id_ = H5Fopen(name.c_str(), mode == Mode::read ? H5F_ACC_RDONLY : H5F_ACC_RDWR, access);
  }
  if (id_ < 0 && mode == Mode::create) fail_to_write("create the file", "/");
  if (id_ < 0) fail("cannot open the file as HDF5", "/");
  errno = 0;  // from here on a reason is the one of what fails
}

Hdf5File::~Hdf5File() {
  if (id_ >= 0 && !broken_) H5Fclose(id_);
  if (mode_ != Mode::update) return;
  try {
    undo_unfinished_update(file_);   // there is none after finish()
  } catch (const std::exception&) {  // left to the next update
  }
}

void Hdf5File::reserve(std::uint64_t bytes, std::size_t data_sets) {
  constexpr std::uint64_t kTables = 1024, kFile = 16384;  // header and place in its group: 630 bytes as measured
  hsize_t end = 0;  // what it has given out already may lie behind the end of the file
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file_, error);
  if (H5Fget_filesize(id_, &end) < 0 || error || end < size) end = size;
  try {
    reserve_space(file_, end - size + bytes + kTables * data_sets + kFile);
  } catch (const DiskError&) {
    broken_ = true;
    require_in_place();
    throw;
  }
}

void Hdf5File::finish() {
  if (H5Fflush(id_, H5F_SCOPE_GLOBAL) < 0) fail_to_write("write", "/");
  const hid_t id = std::exchange(id_, -1);
  if (H5Fclose(id) < 0) fail_to_write("close", "/");
  if (mode_ == Mode::update) std::filesystem::remove(undo_file(file_));
  require_in_place();
}

void Hdf5File::require_in_place() const {
  if (!std::filesystem::exists(file_)) throw DiskError(fmt::format("{}: {}", file_.string(), kTakenAway));
}

void Hdf5File::fail_to_write(std::string_view what, std::string_view path) {
  const int reason = errno;
  broken_ = true;
  std::string_view why = reason != 0 ? std::strerror(reason) : "refused by HDF5";
  if (mode_ == Mode::update && (reason == 0 || reason == ENOENT)) why = kTakenAway;  // it misses what it has written
  throw DiskError(fmt::format("{}: cannot {} ({}): {}", file_.string(), what, path, why));
}

void Hdf5File::fail(std::string_view what, std::string_view path) const {
  throw Hdf5Error(fmt::format("{}: {} ({})", file_.string(), what, path));
}

void Hdf5File::write_raw(const std::string& path, const void* values, std::size_t count, const Shape& shape,
                         std::int64_t memory_type, std::int64_t file_type) {
  const std::size_t product = std::accumulate(shape.begin(), shape.end(), std::size_t{1}, std::multiplies<>());
  if (product != count) fail(fmt::format("{} values do not fill the shape of {}", count, product), path);
  const std::vector<hsize_t> lengths(shape.begin(), shape.end());
  const Handle space(H5Screate_simple(static_cast<int>(lengths.size()), lengths.data(), nullptr), H5Sclose);
  const Handle links(creation_of_missing_groups(), H5Pclose);
  const Handle set(H5Dcreate2(id_, path.c_str(), file_type, space, links, H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
  if (set < 0) fail_to_write("create the data set", path);
  if (count > 0 && H5Dwrite(set, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0) {
    fail_to_write("write the data set", path);
  }
}

void Hdf5File::write(const std::string& path, std::span<const double> values, const Shape& shape) {
  write_raw(path, values.data(), values.size(), shape, H5T_NATIVE_DOUBLE, H5T_IEEE_F64LE);
}

void Hdf5File::write(const std::string& path, std::span<const int> values, const Shape& shape) {
  write_raw(path, values.data(), values.size(), shape, H5T_NATIVE_INT, H5T_STD_I32LE);
}

void Hdf5File::write_bytes(const std::string& path, std::string_view bytes) {
  write_raw(path, bytes.data(), bytes.size(), {bytes.size()}, H5T_NATIVE_UINT8, H5T_STD_U8LE);
}

void Hdf5File::make_group(const std::string& path) {
  const Handle links(creation_of_missing_groups(), H5Pclose);
  const Handle group(H5Gcreate2(id_, path.c_str(), links, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  if (group < 0) fail_to_write("create the group", path);
}

void Hdf5File::remove(const std::string& path) {
  if (H5Ldelete(id_, path.c_str(), H5P_DEFAULT) < 0) fail_to_write("remove", path);
}

void Hdf5File::set_scalar(const std::string& group, const std::string& name, const void* value, std::int64_t type) {
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle attribute(
      H5Acreate_by_name(id_, group.c_str(), name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
      H5Aclose);
  if (attribute < 0 || H5Awrite(attribute, type, value) < 0) fail_to_write("write attribute " + name, group);
}

void Hdf5File::set_attribute(const std::string& group, const std::string& name, double value) {
  set_scalar(group, name, &value, H5T_NATIVE_DOUBLE);
}

void Hdf5File::set_attribute(const std::string& group, const std::string& name, int value) {
  set_scalar(group, name, &value, H5T_NATIVE_INT);
}

void Hdf5File::set_attribute(const std::string& group, const std::string& name, const std::string& value) {
  const Handle type(string_type(value.size()), H5Tclose);
  set_scalar(group, name, value.c_str(), type);
}

Shape Hdf5File::shape(const std::string& path) const {
  const Handle set(H5Dopen2(id_, path.c_str(), H5P_DEFAULT), H5Dclose);
  if (set < 0) fail("no such data set", path);
  const Handle space(H5Dget_space(set), H5Sclose);
  const int axes = H5Sget_simple_extent_ndims(space);
  if (axes < 0) fail("no shape of the data set", path);
  std::vector<hsize_t> lengths(static_cast<std::size_t>(axes));
  H5Sget_simple_extent_dims(space, lengths.data(), nullptr);
  return {lengths.begin(), lengths.end()};
}

/// Number of values; a file that is damaged may claim more than it holds.
std::size_t Hdf5File::count(const std::string& path, const Shape& lengths) const {
  const double claimed = std::accumulate(lengths.begin(), lengths.end(), 1.0, std::multiplies<>());
  if (claimed > static_cast<double>(std::filesystem::file_size(file_)))
    fail("more values than the file has bytes", path);
  return static_cast<std::size_t>(claimed);
}

std::vector<double> Hdf5File::read(const std::string& path) const {
  std::vector<double> values(count(path, shape(path)));
  const Handle set(H5Dopen2(id_, path.c_str(), H5P_DEFAULT), H5Dclose);
  if (!values.empty() && H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) {
    fail("cannot read the data set", path);
  }
  return values;
}

std::string Hdf5File::read_bytes(const std::string& path) const {
  const Shape lengths = shape(path);
  if (lengths.size() != 1) fail("not a row of bytes", path);
  std::string bytes(count(path, lengths), '\0');
  const Handle set(H5Dopen2(id_, path.c_str(), H5P_DEFAULT), H5Dclose);
  if (!bytes.empty() && H5Dread(set, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()) < 0) {
    fail("cannot read the data set", path);
  }
  return bytes;
}

double Hdf5File::number(const std::string& group, const std::string& name) const {
  const Handle attribute(H5Aopen_by_name(id_, group.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  double value = 0;
  if (!is_single(attribute) || H5Aread(attribute, H5T_NATIVE_DOUBLE, &value) < 0) fail("no attribute " + name, group);
  return value;
}

std::string Hdf5File::text(const std::string& group, const std::string& name) const {
  const Handle attribute(H5Aopen_by_name(id_, group.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  if (!is_single(attribute)) fail("no attribute " + name, group);
  const Handle type(H5Aget_type(attribute), H5Tclose);
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) != 0) fail("no text in attribute " + name, group);
  std::string value(H5Tget_size(type), '\0');
  if (H5Aread(attribute, type, value.data()) < 0) fail("cannot read attribute " + name, group);
  value.erase(std::find(value.begin(), value.end(), '\0'), value.end());
  return value;
}

std::vector<std::string> Hdf5File::attributes(const std::string& group) const {
  std::vector<std::string> names;
  const auto collect = [](hid_t, const char* name, const H5A_info_t*, void* list) -> herr_t {
    static_cast<std::vector<std::string>*>(list)->emplace_back(name);
    return 0;
  };
  if (H5Aiterate_by_name(id_, group.c_str(), H5_INDEX_NAME, H5_ITER_INC, nullptr, collect, &names, H5P_DEFAULT) < 0) {
    fail("cannot list the attributes", group);
  }
  return names;
}

bool Hdf5File::exists(const std::string& path) const {
  for (std::size_t end = path.find('/', 1); end != std::string::npos; end = path.find('/', end + 1)) {
    if (H5Lexists(id_, path.substr(0, end).c_str(), H5P_DEFAULT) <= 0) return false;
  }
  return path == "/" || H5Lexists(id_, path.c_str(), H5P_DEFAULT) > 0;
}

std::vector<std::string> Hdf5File::members(const std::string& group) const {
  std::vector<std::string> names;
  if (!exists(group)) return names;
  const Handle handle(H5Gopen2(id_, group.c_str(), H5P_DEFAULT), H5Gclose);
  const auto collect = [](hid_t, const char* name, const H5L_info_t*, void* list) -> herr_t {
    static_cast<std::vector<std::string>*>(list)->emplace_back(name);
    return 0;
  };
  if (H5Literate(handle, H5_INDEX_NAME, H5_ITER_INC, nullptr, collect, &names) < 0) fail("cannot list", group);
  return names;
}

}  // namespace femxdem
