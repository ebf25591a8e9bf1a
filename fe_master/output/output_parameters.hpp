#pragma once

#include <string>

namespace femxdem {

struct OutputParameters {
  std::string directory;          ///< relative to the current folder; empty: the caller chooses
  int every = 1;                  ///< steps between field outputs
  int checkpoint_every = 0;       ///< steps between checkpoints; 0: none
  double checkpoint_minutes = 0;  ///< wall time between checkpoints; 0: none
};

}  // namespace femxdem
