#include "ve_templates.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <regex>

#include "errors.hpp"
#include "hash.hpp"
#include "locations.hpp"
#include "manifest.hpp"
#include "output_folder.hpp"
#include "seconds_since.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

/// What the prepared state depends on: the specification, the files that it names, the versions and scripts that make
/// it.
std::string key_of(const VeParameters& ve, const std::string& specification, const std::string& versions) {
  std::string key = specification + versions;
  for (const std::string& file : {ve.script, ve.scene}) {
    if (!file.empty()) key += read_file(file);
  }
  return hash_text(key + makers(locations().yade_scripts));
}

std::map<std::string, std::string> parse_strings(const std::string& json) {
  static const std::regex entry("\"([^\"]+)\"\\s*:\\s*\"([^\"]*)\"");
  std::map<std::string, std::string> values;
  for (std::sregex_iterator i(json.begin(), json.end(), entry), end; i != end; ++i) values[(*i)[1]] = (*i)[2];
  return values;
}

/// One line on what a manifest says, with its list; nothing where that is empty.
void say_list(std::string_view title, const std::vector<std::string>& texts,
              const std::function<void(std::string_view)>& say) {
  if (!texts.empty()) say(fmt::format("  {}: {}", title, fmt::join(texts, "; ")));
}

void say_manifest(const std::string& manifest, const std::function<void(std::string_view)>& say) {
  say_list("dropped", manifest_texts(manifest, "dropped"), say);
  if (manifest_texts(manifest, "source") != std::vector<std::string>{"prepare"})
    say_list("reset", manifest_texts(manifest, "reset"), say);
  say_list("note", manifest_texts(manifest, "notes"), say);
}

/// Refuses a volume element that is not at rest where it starts: what follows would be its settling, not its stress.
void refuse_unrest(const std::string& manifest, const VeParameters& ve, const fs::path& file) {
  const double unbalanced = manifest_number(manifest, "unbalanced_force").value_or(0.0);
  if (unbalanced <= ve.max_unbalanced_force) return;
  throw UserError(
      fmt::format("{}: the volume element is not at rest as it was made: unbalanced force {:.1e}, limit {:.1e} "
                  "(ve.max_unbalanced_force); let the scene come to rest before its script ends, as by running until "
                  "unbalancedForce() < 0.01",
                  file.string(), unbalanced, ve.max_unbalanced_force));
}

/// State and manifest of the cache where they are whole and of now; else what is wrong with them, empty where they are
/// not there.
struct Cached {
  std::optional<PythonVolumeElements::Template> made;
  std::string reason;
};

Cached look_up(const TemplateFiles& files) {
  std::error_code error;
  if (!fs::exists(files.state, error) || !fs::exists(files.manifest, error)) return {};
  PythonVolumeElements::Template made{read_file(files.state), read_file(files.manifest)};
  const std::vector<std::string> print = manifest_texts(made.manifest, "state");
  if (!print.empty() && print.front() != fingerprint(made.state))
    return {std::nullopt, files.state.string() + " is damaged"};
  if (std::string change = changed_input(made.manifest); !change.empty()) return {std::nullopt, std::move(change)};
  return {std::move(made), {}};
}

void store(const TemplateFiles& files, const PythonVolumeElements::Template& made) {
  const fs::path folder = files.state.parent_path();
  std::error_code error;
  fs::create_directories(folder, error);
  if (error || access(folder.c_str(), W_OK | X_OK) != 0)
    throw UserError(
        fmt::format("the packing cannot be stored in {} ({}); give another ve.cache, a folder that can be written",
                    folder.string(), error ? error.message() : std::strerror(errno)));
  replace_file(files.manifest, made.manifest);
  replace_file(files.state, made.state);
}

}  // namespace

std::string makers(const fs::path& scripts) {
  std::map<std::string, std::string> texts;  // in the order of their names
  for (const fs::path& file : fs::directory_iterator(scripts)) {
    const std::string name = file.filename();
    if (file.extension() == ".py" && name != "protocol.py" && name != "inspect_ve.py") texts[name] = read_file(file);
  }
  std::string all;
  for (const auto& [name, text] : texts) all += name + '\0' + text + '\0';
  return all;
}

fs::path packings_folder(const VeParameters& ve) {
  return ve.cache.empty() ? fs::path("packings") : fs::path(ve.cache);
}

std::string writable_cache(const VeParameters& ve, const fs::path& results) {
  if (!ve.cache.empty() || results.empty()) return ve.cache;
  const fs::path usual = packings_folder(ve);
  std::error_code error;
  const bool there = fs::exists(usual, error);
  const bool writable = access(there ? usual.c_str() : ".", W_OK | X_OK) == 0;
  return writable ? ve.cache : (results / "packings").string();
}

TemplateFiles template_files(PythonVolumeElements& elements, const VeParameters& ve) {
  const fs::path folder = packings_folder(ve);
  const std::string name = key_of(ve, ve_spec_json(ve), elements.versions());
  return {folder / (name + ".state"), folder / (name + ".json")};
}

std::vector<std::string> make_templates(PythonVolumeElements& elements, const std::vector<VeParameters>& pool,
                                        const std::function<void(std::string_view)>& say, int compare) {
  std::vector<std::string> states;
  for (const VeParameters& ve : pool) {
    const TemplateFiles files = template_files(elements, ve);
    const std::string which = fmt::format("volume element {} of {}", states.size() + 1, pool.size());
    Cached cached = compare > 0 ? Cached{} : look_up(files);
    if (!cached.reason.empty()) say(fmt::format("{}: {}; made anew", which, cached.reason));
    if (cached.made) {
      say(fmt::format("{}: {}", which, files.state.string()));
    } else {
      const auto start = std::chrono::steady_clock::now();
      std::string specification = ve_spec_json(ve);
      if (compare > 0) specification.insert(1, fmt::format("\"compare\": {}, ", compare));
      cached.made = elements.make_template(specification);
      const double seconds = seconds_since(start);
      store(files, *cached.made);
      say(fmt::format("{}: made in {:.1f} s, {}", which, seconds, files.state.string()));
    }
    say_manifest(cached.made->manifest, say);
    refuse_unrest(cached.made->manifest, ve, files.state);
    states.push_back(std::move(cached.made->state));
  }
  return states;
}

std::map<std::string, std::string> engine_versions(PythonVolumeElements& elements) {
  return parse_strings(elements.versions());
}

VolumeElementOptions ve_options(const VeParameters& ve) {
  VolumeElementOptions options;
  options.inertial_number = ve.inertial_number;
  options.min_steps = ve.min_steps;
  options.answer_at = answer_at(ve);
  options.start_at_rest = ve.start_at_rest;
  options.hold_steps = ve.hold_steps;
  options.freeze_steps = ve.freeze_steps;
  options.max_unbalanced_force = ve.max_unbalanced_force;
  options.stiffness = ve.stiffness;
  options.quantised = ve.sorted_contacts;
  options.serialise = ve.snapshot == Snapshot::serialise;
  return options;
}

}  // namespace femxdem
