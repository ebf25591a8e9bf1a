#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "hdf5_file.hpp"
#include "material_points.hpp"
#include "named_arrays.hpp"

namespace femxdem {

/// Everything but the states of the points that a run needs to go on from a converged step as if it had never stopped.
struct Checkpoint {
  int step = 0;                                 ///< the last converged step
  double time = 0;                              ///< [s]
  double dt = 0;                                ///< time increment that the next step would have tried [s]
  NamedArrays arrays;                           ///< master's committed state, in order, names unique
  std::string case_text;                        ///< comparable_toml of the case
  std::map<std::string, std::string> versions;  ///< such as {"yade", "2023.02a"}; the states are readable by these only
};

/// What a checkpoint takes.
struct CheckpointSize {
  std::size_t states = 0;   ///< different ones
  std::uint64_t bytes = 0;  ///< of the file
};

/// Writes the checkpoint with the states of the points beside `file`, seals and renames it: `file` is always a whole
/// checkpoint, the old one or the new one, and the one before it is kept as previous_checkpoint(file). Equal states
/// (shared volume elements) are stored once; one state at a time is in memory.
CheckpointSize write_checkpoint(const std::filesystem::path& file, const Checkpoint& checkpoint,
                                MaterialPoints& points);

/// Where a run of this folder keeps its checkpoint.
inline std::filesystem::path checkpoint_of(const std::filesystem::path& folder) { return folder / "checkpoint.h5"; }
/// checkpoint.h5 -> checkpoint.previous.h5
std::filesystem::path previous_checkpoint(const std::filesystem::path& file);

/// A checkpoint that was found whole, open as long as the object lives. All throw UserError.
class CheckpointFile {
 public:
  /// Where there is none, or one that is damaged, of another format or of something else, by which HDF5's library ends
  /// too (tried in a process of its own): a sentence, which names the one before it, if that is whole.
  explicit CheckpointFile(const std::filesystem::path& file);

  /// All but the states, bit-equal. Refuses a checkpoint of other versions than `versions` (of the names that both
  /// have).
  Checkpoint read(const std::map<std::string, std::string>& versions) const;
  /// Reads from this file.
  StateSource states() const;

 private:
  template <class Read>
  auto read_or_refuse(Read read) const;
  void refuse_other_versions(const std::map<std::string, std::string>& versions) const;

  std::filesystem::path file_;
  std::unique_ptr<Hdf5File> h5_;
};

}  // namespace femxdem
