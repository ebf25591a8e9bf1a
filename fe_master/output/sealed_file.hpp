#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace femxdem {

/// Appends a seal to a file that is complete: a mark, its length and a checksum of its bytes. HDF5 does not look behind
/// its own end. Throws DiskError.
void seal(const std::filesystem::path& file);

/// Why the bytes of `file` are not those that were sealed, or nothing: "is cut off, or ...".
std::optional<std::string> broken_seal(const std::filesystem::path& file);

}  // namespace femxdem
