#include "tools.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <iostream>

#include "errors.hpp"
#include "locations.hpp"

namespace femxdem {
namespace {

constexpr auto kTools = std::to_array<Tool>({
    {"advise", "advise.py", "Advice before a run, from short probes of its volume element"},
    {"report", "report.py", "One HTML page of a run: curve, maps, band, convergence, engine check, versions, case"},
    {"plot", "plot.py", "Figures of a run: curve, maps on the deformed mesh, cost of the steps"},
    {"band", "band.py", "Thickness and inclination of a shear band"},
    {"spirals", "spirals.py", "Bands that start at the wall of a hollow cylinder"},
});

}  // namespace

std::span<const Tool> tools() { return kTools; }

const Tool* find_tool(std::string_view name) {
  const auto* found = std::find_if(kTools.begin(), kTools.end(), [&](const Tool& tool) { return tool.name == name; });
  return found == kTools.end() ? nullptr : found;
}

void become_python(const std::filesystem::path& script, const std::vector<std::string>& arguments) {
  std::vector<std::string> words = {FEMXDEM_PYTHON, script.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  setenv("PYTHONPATH", locations().modules.c_str(), 1);
  setenv("FEMXDEM", std::filesystem::read_symlink("/proc/self/exe").c_str(), 1);
  setenv("FEMXDEM_YADE_DIR", FEMXDEM_YADE_DIR, 0);
  setenv("OMP_NUM_THREADS", "1", 1);
  setenv("HOME", "/tmp", 0);  // Matplotlib looks for it
  std::cout.flush();
  execv(argv[0], argv.data());
  throw UserError(
      fmt::format("{}: cannot be started ({}); configure with -DFEMXDEM_PYTHON=...", argv[0], std::strerror(errno)));
}

void become(const Tool& tool, const std::vector<std::string>& arguments) {
  become_python(locations().tools / tool.script, arguments);
}

}  // namespace femxdem
