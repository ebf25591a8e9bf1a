#include "checkpoint.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "disk_file.hpp"
#include "errors.hpp"
#include "own_process.hpp"
#include "sealed_file.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

std::string place_of(int state) { return fmt::format("/states/{:06d}", state); }

/// The states as they come, equal ones once.
class StateWriter {
 public:
  StateWriter(Hdf5File& h5, std::size_t points) : h5_(h5), number_of_point_(points) {}

  void take(const std::string& state, std::span<const std::size_t> points) {
    const int number = number_of(state);
    for (const std::size_t point : points) number_of_point_[point] = number;
  }
  void finish(const std::vector<int>& histories) {
    h5_.write("/state_of_point", number_of_point_, {number_of_point_.size()});
    h5_.write("/history_of_point", histories.empty() ? number_of_point_ : histories, {number_of_point_.size()});
  }
  std::size_t states() const { return known_.size(); }

 private:
  /// Of equal hashes the bytes are compared with those in the file.
  int number_of(const std::string& state) {
    const std::size_t hash = std::hash<std::string_view>()(state);
    const auto [first, last] = known_.equal_range(hash);
    for (auto entry = first; entry != last; ++entry)
      if (h5_.read_bytes(place_of(entry->second)) == state) return entry->second;
    const int number = static_cast<int>(known_.size());
    h5_.reserve(state.size(), 1);
    h5_.write_bytes(place_of(number), state);
    known_.emplace(hash, number);
    return number;
  }

  Hdf5File& h5_;
  std::unordered_multimap<std::size_t, int> known_;  // hash -> number
  std::vector<int> number_of_point_;
};

std::uint64_t size_of(const Checkpoint& checkpoint) {
  std::uint64_t bytes = checkpoint.case_text.size();
  for (const auto& [name, values] : checkpoint.arrays) bytes += 8 * values.size();
  return bytes;
}

std::size_t write_file(const fs::path& file, const Checkpoint& checkpoint, MaterialPoints& points) {
  Hdf5File h5(file, Hdf5File::Mode::create);
  h5.reserve(size_of(checkpoint) + 8 * points.size(), checkpoint.arrays.size() + checkpoint.versions.size() + 9);
  h5.set_attribute("/", "step", checkpoint.step);
  h5.set_attribute("/", "time", checkpoint.time);
  h5.set_attribute("/", "dt", checkpoint.dt);
  h5.make_group("/versions");
  for (const auto& [name, version] : checkpoint.versions) h5.set_attribute("/versions", name, version);
  int order = 0;
  for (const auto& [name, values] : checkpoint.arrays) {
    const std::string group = fmt::format("/arrays/{:04d}", order++);
    h5.write(group + "/values", values, {values.size()});
    h5.set_attribute(group, "name", name);
  }
  h5.write_bytes("/case", checkpoint.case_text);
  StateWriter states(h5, points.size());
  points.save_each(
      [&](const std::string& state, std::span<const std::size_t> of_points) { states.take(state, of_points); });
  states.finish(points.histories());
  h5.finish();
  return states.states();
}

/// What else there is to restart from.
std::string offer(const fs::path& file) {
  const fs::path previous = previous_checkpoint(file);
  if (broken_seal(previous)) return "; start without --restart";
  try {
    const int step = static_cast<int>(Hdf5File(previous, Hdf5File::Mode::read).number("/", "step"));
    return fmt::format("; the one before it, after step {}, is whole: `mv {} {}`, then --restart goes on from there",
                       step, previous.string(), file.string());
  } catch (const Hdf5Error&) {
    return "; start without --restart";
  }
}

}  // namespace

fs::path previous_checkpoint(const fs::path& file) {
  fs::path previous = file;
  return previous.replace_filename(file.stem().string() + ".previous" + file.extension().string());
}

CheckpointSize write_checkpoint(const fs::path& file, const Checkpoint& checkpoint, MaterialPoints& points) {
  fs::path beside = file;
  beside += ".new";
  CheckpointSize size;
  try {
    size.states = write_file(beside, checkpoint, points);
    seal(beside);
    size.bytes = fs::file_size(beside);
    keep_as(file, previous_checkpoint(file));
    put_in_place(beside, file);
  } catch (const DiskError&) {
    std::error_code ignored;
    fs::remove(beside, ignored);
    throw;
  }
  return size;
}

template <class Read>
auto CheckpointFile::read_or_refuse(Read read) const {
  try {
    return read();
  } catch (const Hdf5Error& error) {
    throw UserError(
        fmt::format("{}: is no checkpoint of this program ({}){}", file_.string(), error.what(), offer(file_)));
  }
}

CheckpointFile::CheckpointFile(const fs::path& file) : file_(file) {
  const std::string name = file.string();
  if (!fs::exists(file)) throw UserError(fmt::format("{}: no checkpoint to restart from{}", name, offer(file)));
  if (const auto fault = broken_seal(file)) throw UserError(fmt::format("{}: {}{}", name, *fault, offer(file)));
  const auto open = [&] { h5_ = std::make_unique<Hdf5File>(file, Hdf5File::Mode::read); };
  const auto end = what_ends([&] {
    Hdf5File::forget_memory();
    open();
    try {
      read({});
      states();
    } catch (const UserError&) {  // it is said by the process that reads the file for good
    }
    h5_.reset();  // closing ends it too
  });
  if (end)
    throw UserError(fmt::format("{}: HDF5's library cannot read it (it ends with {}){}", name, *end, offer(file)));
  read_or_refuse(open);
}

void CheckpointFile::refuse_other_versions(const std::map<std::string, std::string>& versions) const {
  const std::vector<std::string> written_with = h5_->attributes("/versions");
  for (const auto& [name, version] : versions) {
    if (std::find(written_with.begin(), written_with.end(), name) == written_with.end()) continue;
    const std::string theirs = h5_->text("/versions", name);
    if (theirs == version) continue;
    throw UserError(fmt::format(
        "{}: written with {} {}, this program has {}: states cannot be read across versions; use the version it was "
        "written with or start without --restart",
        file_.string(), name, theirs, version));
  }
}

Checkpoint CheckpointFile::read(const std::map<std::string, std::string>& versions) const {
  return read_or_refuse([&] {
    refuse_other_versions(versions);
    Checkpoint checkpoint;
    checkpoint.step = static_cast<int>(h5_->number("/", "step"));
    checkpoint.time = h5_->number("/", "time");
    checkpoint.dt = h5_->number("/", "dt");
    checkpoint.case_text = h5_->read_bytes("/case");
    for (const std::string& name : h5_->attributes("/versions"))
      checkpoint.versions[name] = h5_->text("/versions", name);
    for (const std::string& order : h5_->members("/arrays")) {
      const std::string group = "/arrays/" + order;
      checkpoint.arrays.emplace_back(h5_->text(group, "name"), h5_->read(group + "/values"));
    }
    return checkpoint;
  });
}

StateSource CheckpointFile::states() const {
  StateSource source;
  const auto numbers = [this](const char* place) {
    const std::vector<double> values = read_or_refuse([&] { return h5_->read(place); });
    return std::vector<int>(values.begin(), values.end());
  };
  source.number_of_point = numbers("/state_of_point");
  source.history_of_point = numbers("/history_of_point");
  source.read = [this](int number) { return read_or_refuse([&] { return h5_->read_bytes(place_of(number)); }); };
  return source;
}

}  // namespace femxdem
