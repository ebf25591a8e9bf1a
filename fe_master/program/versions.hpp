#pragma once

#include <map>
#include <string>

namespace femxdem {

/// Versions of this program and of the libraries that it is built with: femxdem, git, Open MPI, HDF5, SuiteSparse,
/// Eigen.
std::map<std::string, std::string> library_versions();

/// Text of `femxdem --version`: the above, YADE and its Python, and one sentence for what is missing.
std::string describe_versions();

}  // namespace femxdem
