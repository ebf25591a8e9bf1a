#pragma once

#include <optional>
#include <string>
#include <vector>

#include "run_files.hpp"

namespace femxdem {

/// What the command line asks for; each command knows its own.
struct Arguments {
  std::string file;                    ///< case file, or a prepared state (ve inspect)
  std::string folder;                  ///< where the results go; empty: the command's default
  std::vector<std::string> overrides;  ///< section.key=value
  bool restart = false;
  bool overwrite = false;
  std::string time_limit;               ///< of this process, see seconds_of; empty: the scheduler's
  Moment start = Moment::clock::now();  ///< from which it counts
  std::optional<bool> progress;         ///< RunOptions::progress
  int noise_samples = 0;                ///< ve path: probes of the stress's jitter in each step
  int compare = 0;                      ///< ve prepare: DEM steps beside the scene's own continuation in YADE
  bool markdown = false;
  bool effective = false;  ///< check: print the case as it would run
  std::string command_line;
};

/// Options of a run of the case; without a folder its results go to that of the case, or to out/NAME, with the ending.
RunOptions run_options(const Arguments& arguments, const Case& c, const char* ending = "");

}  // namespace femxdem
