#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace femxdem {

/// FNV-1a hash of the bytes, 64 bits (Fowler, Noll, Vo 1991): names files of a cache and cases, and guards states.
std::uint64_t hash(std::string_view bytes);
/// The same as 16 hexadecimal digits.
std::string hash_text(std::string_view bytes);

/// Checksum of megabytes: FNV-1a over words of eight bytes in four lanes, which are independent of each other and so as
/// fast as memory.
class Checksum {
 public:
  /// Further bytes: a multiple of eight, but for the last.
  void add(std::string_view bytes);
  std::uint64_t value() const;

 private:
  std::array<std::uint64_t, 4> lanes_ = {0xcbf29ce484222325ULL, 1, 2, 3};
  std::uint64_t size_ = 0;
};

}  // namespace femxdem
