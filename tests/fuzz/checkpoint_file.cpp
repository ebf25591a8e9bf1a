// The reader of checkpoints: the seal as it is, then, behind a good one, HDF5's library and what is made of its answer.
#include "checkpoint.hpp"
#include "errors.hpp"
#include "sealed_file.hpp"
#include "target.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  const femxdem::Removed checkpoint{femxdem::file_of(bytes, size, ".h5")};
  try {
    if (femxdem::broken_seal(checkpoint.file)) femxdem::seal(checkpoint.file);
    femxdem::CheckpointFile(checkpoint.file).read({{"yade", "2023.02a"}});
  } catch (const femxdem::UserError&) {
  }
  return 0;
}
