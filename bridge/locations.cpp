#include "locations.hpp"

namespace femxdem {
namespace {

Locations find() {
  const std::filesystem::path here = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  if (std::filesystem::exists(here / "yade_scripts"))
    return {here / "femxdem-worker", here, here / "yade_scripts", here / "program"};
  return {FEMXDEM_WORKER, FEMXDEM_PYTHON_MODULES, FEMXDEM_SOURCE "/yade_scripts", FEMXDEM_SOURCE "/fe_master/program"};
}

}  // namespace

const Locations& locations() {
  static const Locations found = find();
  return found;
}

}  // namespace femxdem
