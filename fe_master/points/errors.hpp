#pragma once

#include <stdexcept>

namespace femxdem {

/// A mistake of the user: its text is one clear sentence (what, where, what to do); the program ends with status 2.
struct UserError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A file could not be written: its text is one sentence with the file and the system's reason; status 5.
struct DiskError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Exit status of the program.
enum ExitStatus : int {
  kDone = 0,
  kBadInput = 2,
  kNotConverged = 3,  ///< every converged step is on the disk
  kPointFailed = 4,   ///< a volume element failed and smaller steps did not help
  kNotWritten = 5,    ///< a file could not be written: disk full, quota
  kRunAgain = 75,     ///< ended before it was done, because it was told to or its time was over: --restart goes on
};

}  // namespace femxdem
