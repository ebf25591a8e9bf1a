// The reader of case files, with all checks that run before a mesh is made.
#include "case.hpp"
#include "errors.hpp"
#include "target.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  const femxdem::Removed text{femxdem::file_of(bytes, size, ".toml")};
  try {
    femxdem::effective_toml(femxdem::read_case(text.file));
  } catch (const femxdem::UserError&) {
  }
  return 0;
}
