#include "ve_templates.hpp"

#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <regex>

#include "hash.hpp"
#include "output_folder.hpp"

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
  return hash_text(key + makers(FEMXDEM_YADE_SCRIPTS));
}

std::map<std::string, std::string> parse_strings(const std::string& json) {
  static const std::regex entry("\"([^\"]+)\"\\s*:\\s*\"([^\"]*)\"");
  std::map<std::string, std::string> values;
  for (std::sregex_iterator i(json.begin(), json.end(), entry), end; i != end; ++i) values[(*i)[1]] = (*i)[2];
  return values;
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

TemplateFiles template_files(PythonVolumeElements& elements, const VeParameters& ve) {
  const fs::path folder = ve.cache.empty() ? fs::path("packings") : fs::path(ve.cache);
  const std::string name = key_of(ve, ve_spec_json(ve), elements.versions());
  return {folder / (name + ".state"), folder / (name + ".json")};
}

std::vector<std::string> make_templates(PythonVolumeElements& elements, const std::vector<VeParameters>& pool,
                                        const std::function<void(std::string_view)>& say) {
  std::vector<std::string> states;
  for (const VeParameters& ve : pool) {
    const auto [state, manifest] = template_files(elements, ve);
    if (fs::exists(state) && fs::exists(manifest)) {
      states.push_back(read_file(state));
      say(fmt::format("volume element {} of {}: {}", states.size(), pool.size(), state.string()));
      continue;
    }
    const auto start = std::chrono::steady_clock::now();
    const auto made = elements.make_template(ve_spec_json(ve));
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    fs::create_directories(state.parent_path());
    replace_file(manifest, made.manifest);
    replace_file(state, made.state);
    states.push_back(made.state);
    say(fmt::format("volume element {} of {}: made in {:.1f} s, {}", states.size(), pool.size(), seconds,
                    state.string()));
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
  options.freeze_steps = ve.freeze_steps;
  options.max_unbalanced_force = ve.max_unbalanced_force;
  options.relaxed = ve.stiffness == VeStiffness::relaxed;
  options.serialise = ve.snapshot == Snapshot::serialise;
  return options;
}

}  // namespace femxdem
