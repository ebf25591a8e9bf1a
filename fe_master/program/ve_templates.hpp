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
/// forgotten, but the contract and the drawing of what has been prepared. A change in one of them, even
/// where it decides nothing, costs a preparation.
std::string makers(const std::filesystem::path& scripts);

/// States of the volume elements that a case starts from, one per entry of `pool`: from the cache folder where they
/// are, else prepared (or adopted from a scene or a user's script) and put there with their manifests.
/// A packing of the cache is made anew where a file that its script read has changed, or where it is damaged. `say`
/// gets a line for each, and what was dropped, reset and noted. Above 0, `compare` makes them all anew, each beside
/// that many DEM steps of the scene's own continuation. Throws UserError where one is not at rest or cannot be stored.
std::vector<std::string> make_templates(PythonVolumeElements& elements, const std::vector<VeParameters>& pool,
                                        const std::function<void(std::string_view)>& say, int compare = 0);

/// ve.cache, or where none is given and the working folder cannot be written a folder in that of the results.
std::string writable_cache(const VeParameters& ve, const std::filesystem::path& results);

/// Versions of YADE and of its Python.
std::map<std::string, std::string> engine_versions(PythonVolumeElements& elements);

/// Options of a rank's volume elements.
VolumeElementOptions ve_options(const VeParameters& ve);

}  // namespace femxdem
