// The reader of Gmsh's meshes: Gmsh's own library, and what is made of its answer.
#include "errors.hpp"
#include "mesh.hpp"
#include "target.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  const femxdem::Removed mesh{femxdem::file_of(bytes, size, ".msh")};
  try {
    femxdem::gmsh_mesh(mesh.file);
  } catch (const femxdem::UserError&) {
  }
  return 0;
}
