#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace femxdem {

/// FNV-1a hash of the bytes, 64 bits (Fowler, Noll, Vo 1991): names files of a cache and cases, and guards states.
std::uint64_t hash(std::string_view bytes);
/// The same as 16 hexadecimal digits.
std::string hash_text(std::string_view bytes);

}  // namespace femxdem
