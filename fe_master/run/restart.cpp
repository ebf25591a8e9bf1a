#include "restart.hpp"

#include <fmt/format.h>

#include <map>
#include <set>
#include <sstream>

#include "errors.hpp"

namespace femxdem {
namespace {

using Parameters = std::map<std::string, std::string>;

/// "section.key" or "section.number.key" -> value, of a text of effective_toml.
Parameters parameters(const std::string& toml) {
  Parameters found;
  std::map<std::string, int> count;
  std::string section;
  std::istringstream lines(toml);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("[[")) {
      const std::string name = line.substr(2, line.find(']') - 2);
      section = fmt::format("{}.{}", name, count[name]++);
    } else if (line.starts_with("[")) {
      section = line.substr(1, line.find(']') - 1);
    } else if (const auto equal = line.find(" = "); equal != std::string::npos && !line.starts_with("#")) {
      found[section + "." + line.substr(0, equal)] = line.substr(equal + 3);
    }
  }
  return found;
}

/// Whether a key's value is the hash of a file's contents.
bool is_file(const std::string& key) {
  return key.ends_with(".file") || key.ends_with(".script") || key.ends_with(".scene");
}

std::string describe(const std::string& key, const Parameters& theirs, const Parameters& ours) {
  if (is_file(key)) return key + " (another content)";
  const auto value = [&key](const Parameters& p) { return p.count(key) > 0 ? p.at(key) : std::string("not given"); };
  return fmt::format("{} ({}, now {})", key, value(theirs), value(ours));
}

std::set<std::string> differing(const Parameters& theirs, const Parameters& ours) {
  std::set<std::string> keys;
  for (const auto& [key, value] : theirs)
    if (ours.count(key) == 0 || ours.at(key) != value) keys.insert(key);
  for (const auto& [key, value] : ours)
    if (theirs.count(key) == 0) keys.insert(key);
  return keys;
}

/// Number of the first load whose default factor is time / end_time; -1: none.
int load_until_the_end(const Case& c) {
  for (std::size_t i = 0; i < c.loads.size(); ++i) {
    const Load& load = c.loads[i];
    const bool by_default = load.kind == LoadKind::displacement || load.kind == LoadKind::gradient;
    if (by_default && load.table.empty() && load.value != 0) return static_cast<int>(i);
  }
  return -1;
}

}  // namespace

Resumed resumed_from(const RunOptions& options, const Case& c) {
  if (options.existing != Existing::resume) return {};
  const std::filesystem::path place = checkpoint_of(options.folder);
  Resumed resumed{std::make_unique<CheckpointFile>(place), {}};
  resumed.checkpoint = resumed.file->read(options.versions);
  refuse_other_case(place, resumed.checkpoint, c);
  return resumed;
}

void refuse_other_case(const std::filesystem::path& file, const Checkpoint& checkpoint, const Case& c) {
  const Parameters then = parameters(checkpoint.case_text), now = parameters(comparable_toml(c));
  const std::set<std::string> keys = differing(then, now);
  if (keys.empty()) return;
  std::string differences;
  for (const std::string& key : keys) differences += (differences.empty() ? "" : ", ") + describe(key, then, now);
  const std::string where = file.string();
  if (keys != std::set<std::string>{"control.end_time"})
    throw UserError(
        fmt::format("{}: belongs to another case, which differs in {}; restart with the case it was written by or "
                    "choose another --out",
                    where, differences));
  if (const int load = load_until_the_end(c); load >= 0)
    throw UserError(
        fmt::format("{}: the case differs in {}, and load.{} depends on it (its factor is time / end_time): give that "
                    "load a table or a velocity from the start, or restart with the old end",
                    where, differences, load));
  if (c.control.end_time < checkpoint.time)
    throw UserError(
        fmt::format("{}: was written at time {:g}, beyond the new control.end_time = {:g}; give a later one", where,
                    checkpoint.time, c.control.end_time));
}

}  // namespace femxdem
