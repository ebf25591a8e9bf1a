#pragma once

#include <pthread.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

/// What a reader is given: these bytes as a file of its own. Returns 0; whatever else than a UserError leaves it is a
/// fault.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size);

namespace femxdem {

/// The bytes as a file of this process, with that extension, in memory where the system has /dev/shm.
inline std::string file_of(const std::uint8_t* bytes, std::size_t size, const std::string& extension) {
  const std::filesystem::path folder = std::filesystem::is_directory("/dev/shm")
                                           ? std::filesystem::path("/dev/shm")
                                           : std::filesystem::temp_directory_path();
  const std::string file = (folder / ("femxdem_fuzz_" + std::to_string(getpid()) + extension)).string();
  std::ofstream(file, std::ios::binary).write(reinterpret_cast<const char*>(bytes), static_cast<std::streamsize>(size));
  return file;
}

/// What ends a process that a reader has made for a library is no crash of the reader: libFuzzer shall not keep it.
extern "C" void __sanitizer_set_death_callback(void (*)()) __attribute__((weak));
inline const int deaths_of_children_are_not_told = pthread_atfork(nullptr, nullptr, [] {
  if (__sanitizer_set_death_callback) __sanitizer_set_death_callback(nullptr);
});

/// Removes it at the end of the scope.
struct Removed {
  std::string file;
  ~Removed() { std::filesystem::remove(file); }
};

}  // namespace femxdem
