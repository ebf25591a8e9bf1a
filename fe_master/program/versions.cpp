#include "versions.hpp"

#include <cholmod.h>
#include <fmt/format.h>
#include <hdf5.h>
#include <mpi.h>

#include <Eigen/Core>

#include "locations.hpp"
#include "ve_templates.hpp"

namespace femxdem {

std::map<std::string, std::string> library_versions() {
  char mpi[MPI_MAX_LIBRARY_VERSION_STRING];
  int length = 0;
  MPI_Get_library_version(mpi, &length);
  const std::string mpi_text(mpi, length);
  return {{"femxdem", FEMXDEM_VERSION},
          {"mpi", mpi_text.substr(0, mpi_text.find(','))},
          {"hdf5", fmt::format("{}.{}.{}", H5_VERS_MAJOR, H5_VERS_MINOR, H5_VERS_RELEASE)},
          {"suitesparse",
           fmt::format("{}.{}.{} (CHOLMOD {}.{}.{})", SUITESPARSE_MAIN_VERSION, SUITESPARSE_SUB_VERSION,
                       SUITESPARSE_SUBSUB_VERSION, CHOLMOD_MAIN_VERSION, CHOLMOD_SUB_VERSION, CHOLMOD_SUBSUB_VERSION)},
          {"eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)}};
}

std::string describe_versions() {
  std::map<std::string, std::string> versions = library_versions();
  std::string missing;
  try {
    WorkerProcess worker({});
    PythonVolumeElements elements(worker, {});
    versions.merge(engine_versions(elements));
  } catch (const std::exception& error) {
    missing = fmt::format("missing: YADE ({}); bash setup.sh build installs it\n", error.what());
  }
  std::string text;
  for (const auto& [name, version] : versions) text += fmt::format("{:12} {}\n", name, version);
  return text + fmt::format("{:12} {}\n", "scripts", locations().yade_scripts.string()) + missing;
}

}  // namespace femxdem
