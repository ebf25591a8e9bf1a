#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <system_error>

namespace femxdem {

/// What the system says now (errno), of `what`.
std::system_error system_error(const char* what);

/// Puts bytes into the anonymous file behind `descriptor` (replacing what was there) and returns their number.
/// Throws std::system_error.
std::int64_t put_mail(int descriptor, std::string_view bytes);

/// The first `size` bytes of it. Throws std::system_error, std::runtime_error if there are fewer.
std::string get_mail(int descriptor, std::int64_t size);

/// Maps the file behind `descriptor` into shared memory. Throws std::system_error.
void* map_shared(int descriptor, std::size_t size);

}  // namespace femxdem
