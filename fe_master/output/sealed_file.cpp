#include "sealed_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <string_view>
#include <vector>

#include "disk_file.hpp"
#include "hash.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMark = "femxdem: whole 2";  // 16 bytes, the format's version at the end
constexpr std::size_t kPiece = std::size_t{1} << 20;

struct Seal {
  std::array<char, kMark.size()> mark{};
  std::uint64_t size = 0, checksum = 0;
};
static_assert(sizeof(Seal) == 32);

/// Of the first `size` bytes.
std::uint64_t checksum_of(const fs::path& file, std::uint64_t size) {
  std::ifstream stream(file, std::ios::binary);
  std::vector<char> piece(kPiece);
  Checksum sum;
  for (std::uint64_t done = 0; done < size && stream;) {
    stream.read(piece.data(), static_cast<std::streamsize>(std::min<std::uint64_t>(kPiece, size - done)));
    sum.add({piece.data(), static_cast<std::size_t>(stream.gcount())});
    done += static_cast<std::uint64_t>(stream.gcount());
  }
  return sum.value();
}

}  // namespace

void seal(const fs::path& file) {
  Seal seal;
  std::copy(kMark.begin(), kMark.end(), seal.mark.begin());
  seal.size = fs::file_size(file);
  seal.checksum = checksum_of(file, seal.size);
  AppendedFile(file, true).write({reinterpret_cast<const char*>(&seal), sizeof seal});
}

std::optional<std::string> broken_seal(const fs::path& file) {
  std::error_code error;
  const std::uint64_t size = fs::file_size(file, error);
  Seal seal;
  std::ifstream stream(file, std::ios::binary);
  if (error || !stream) return "cannot be read";
  if (size > sizeof seal) {
    stream.seekg(-static_cast<std::streamoff>(sizeof seal), std::ios::end);
    stream.read(reinterpret_cast<char*>(&seal), sizeof seal);
  }
  const std::string_view mark(seal.mark.data(), seal.mark.size());
  if (!mark.starts_with(kMark.substr(0, kMark.size() - 1))) return "is cut off, or not a checkpoint of this program";
  if (mark != kMark)
    return fmt::format("has version {} of the format, this program reads version {}", mark.back(), kMark.back());
  if (seal.size != size - sizeof seal) return fmt::format("has {} bytes instead of {}", size - sizeof seal, seal.size);
  if (seal.checksum != checksum_of(file, seal.size)) return "is damaged: its checksum is not that of its bytes";
  return std::nullopt;
}

}  // namespace femxdem
