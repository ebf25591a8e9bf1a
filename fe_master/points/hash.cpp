#include "hash.hpp"

#include <fmt/format.h>

namespace femxdem {

std::uint64_t hash(std::string_view bytes) {
  std::uint64_t h = 14695981039346656037ull;
  for (const unsigned char c : bytes) h = (h ^ c) * 1099511628211ull;
  return h;
}

std::string hash_text(std::string_view bytes) { return fmt::format("{:016x}", hash(bytes)); }

}  // namespace femxdem
