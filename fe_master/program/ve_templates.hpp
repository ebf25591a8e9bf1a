#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "case.hpp"
#include "python_volume_elements.hpp"

namespace femxdem {

/// Where the cache holds a prepared volume element.
struct TemplateFiles {
  std::filesystem::path state;
  std::filesystem::path manifest;  ///< JSON
};
TemplateFiles template_files(PythonVolumeElements& elements, const VeParameters& ve);

/// Names and texts of the scripts that decide what a volume element is prepared to: all of the folder, so that none is
/// forgotten, but the contract with its dummy and the drawing of what has been prepared. A change in one of them, even
/// where it decides nothing, costs a preparation.
std::string makers(const std::filesystem::path& scripts);

/// States of the volume elements that a case starts from, one per entry of `pool`: from the cache folder where they
/// are, else prepared (or adopted from a scene or a user's script) and put there with their manifests.
/// `say` gets one line for each.
std::vector<std::string> make_templates(PythonVolumeElements& elements, const std::vector<VeParameters>& pool,
                                        const std::function<void(std::string_view)>& say);

/// Versions of YADE and of its Python.
std::map<std::string, std::string> engine_versions(PythonVolumeElements& elements);

/// Options of a rank's volume elements.
VolumeElementOptions ve_options(const VeParameters& ve);

}  // namespace femxdem
