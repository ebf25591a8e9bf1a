#pragma once

#include <filesystem>

namespace femxdem {

/// Where the parts of the program lie. An installed program holds them in its own folder, which may be moved; one of
/// the build tree has its scripts in the source tree.
struct Locations {
  std::filesystem::path worker;        ///< femxdem-worker
  std::filesystem::path modules;       ///< folder of the Python modules compact_cell and contact_network
  std::filesystem::path yade_scripts;  ///< folder
  std::filesystem::path tools;         ///< folder of plot.py, band.py, report.py, ...
};

/// By the folder of this executable, links resolved: all of it or nothing is taken from there.
const Locations& locations();

}  // namespace femxdem
