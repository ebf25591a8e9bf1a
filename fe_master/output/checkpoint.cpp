#include "checkpoint.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <unordered_map>

#include "disk_file.hpp"
#include "errors.hpp"
#include "hdf5_file.hpp"

namespace femxdem {
namespace {

void write_states(Hdf5File& h5, const SavedStates& states) {
  std::unordered_map<std::string_view, int> number_of;
  std::vector<int> number_of_point;
  for (const std::string& state : states) {
    const auto [entry, is_new] = number_of.emplace(state, static_cast<int>(number_of.size()));
    if (is_new) h5.write_bytes(fmt::format("/states/{:06d}", entry->second), state);
    number_of_point.push_back(entry->second);
  }
  h5.write("/state_of_point", number_of_point, {number_of_point.size()});
}

SavedStates read_states(const Hdf5File& h5) {
  std::vector<std::string> distinct;
  for (const std::string& name : h5.members("/states")) distinct.push_back(h5.read_bytes("/states/" + name));
  SavedStates states;
  for (const double number : h5.read("/state_of_point")) {
    if (!(number >= 0 && number < static_cast<double>(distinct.size()))) throw Hdf5Error("a point without a state");
    states.push_back(distinct[static_cast<std::size_t>(number)]);
  }
  return states;
}

std::uint64_t size_of(const Checkpoint& checkpoint) {
  std::uint64_t bytes = 4 * checkpoint.states.size() + checkpoint.case_text.size();
  for (const auto& [name, values] : checkpoint.arrays) bytes += 8 * values.size();
  std::unordered_map<std::string_view, int> distinct;
  for (const std::string& state : checkpoint.states)
    if (distinct.emplace(state, 0).second) bytes += state.size();
  return bytes;
}

void write_file(const std::filesystem::path& file, const Checkpoint& checkpoint) {
  Hdf5File h5(file, Hdf5File::Mode::create);
  h5.reserve(size_of(checkpoint), checkpoint.arrays.size() + checkpoint.states.size() + checkpoint.versions.size() + 8);
  h5.set_attribute("/", "step", checkpoint.step);
  h5.set_attribute("/", "time", checkpoint.time);
  h5.set_attribute("/", "dt", checkpoint.dt);
  h5.set_attribute("/", "case_hash", checkpoint.case_hash);
  h5.make_group("/versions");
  for (const auto& [name, version] : checkpoint.versions) h5.set_attribute("/versions", name, version);
  int order = 0;
  for (const auto& [name, values] : checkpoint.arrays) {
    const std::string group = fmt::format("/arrays/{:04d}", order++);
    h5.write(group + "/values", values, {values.size()});
    h5.set_attribute(group, "name", name);
  }
  if (!checkpoint.case_text.empty()) h5.write_bytes("/case", checkpoint.case_text);
  write_states(h5, checkpoint.states);
  h5.finish();
}

void refuse_other_case(const std::filesystem::path& file, const Hdf5File& h5, const std::string& case_hash) {
  const std::string theirs = h5.text("/", "case_hash");
  if (theirs == case_hash) return;
  throw UserError(fmt::format(
      "{}: belongs to another case (hash {}, this case has {}); restart with the case it was written by or choose "
      "another --out",
      file.string(), theirs, case_hash));
}

void refuse_other_versions(const std::filesystem::path& file, const Hdf5File& h5,
                           const std::map<std::string, std::string>& versions) {
  const std::vector<std::string> written_with = h5.attributes("/versions");
  for (const auto& [name, version] : versions) {
    if (std::find(written_with.begin(), written_with.end(), name) == written_with.end()) continue;
    const std::string theirs = h5.text("/versions", name);
    if (theirs == version) continue;
    throw UserError(fmt::format(
        "{}: written with {} {}, this program has {}: states cannot be read across versions; use the version it was "
        "written with or start without --restart",
        file.string(), name, theirs, version));
  }
}

Checkpoint read_contents(const Hdf5File& h5) {
  Checkpoint checkpoint;
  checkpoint.step = static_cast<int>(h5.number("/", "step"));
  checkpoint.time = h5.number("/", "time");
  checkpoint.dt = h5.number("/", "dt");
  checkpoint.case_hash = h5.text("/", "case_hash");
  for (const std::string& name : h5.attributes("/versions")) checkpoint.versions[name] = h5.text("/versions", name);
  for (const std::string& order : h5.members("/arrays")) {
    const std::string group = "/arrays/" + order;
    checkpoint.arrays.emplace_back(h5.text(group, "name"), h5.read(group + "/values"));
  }
  checkpoint.states = read_states(h5);
  return checkpoint;
}

}  // namespace

void write_checkpoint(const std::filesystem::path& file, const Checkpoint& checkpoint) {
  std::filesystem::path beside = file;
  beside += ".new";
  try {
    write_file(beside, checkpoint);
    put_in_place(beside, file);
  } catch (const DiskError&) {
    std::error_code ignored;
    std::filesystem::remove(beside, ignored);
    throw;
  }
}

Checkpoint read_checkpoint(const std::filesystem::path& file, const std::string& case_hash,
                           const std::map<std::string, std::string>& versions) {
  if (!std::filesystem::exists(file)) {
    throw UserError(fmt::format("{}: no checkpoint to restart from; start without --restart", file.string()));
  }
  try {
    const Hdf5File h5(file, Hdf5File::Mode::read);
    refuse_other_case(file, h5, case_hash);
    refuse_other_versions(file, h5, versions);
    return read_contents(h5);
  } catch (const UserError&) {
    throw;
  } catch (const std::exception&) {  // of HDF5, or for want of the memory that damaged lengths ask for
    throw UserError(fmt::format("{}: is not a whole checkpoint; start without --restart", file.string()));
  }
}

}  // namespace femxdem
