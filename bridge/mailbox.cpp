#include "mailbox.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>

namespace femxdem {

std::system_error system_error(const char* what) { return {errno, std::generic_category(), what}; }

std::int64_t put_mail(int descriptor, std::string_view bytes) {
  if (ftruncate(descriptor, 0) != 0 || ftruncate(descriptor, static_cast<off_t>(bytes.size())) != 0)
    throw system_error("mailbox of the worker: cannot be sized");
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t written = pwrite(descriptor, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) throw system_error("mailbox of the worker: cannot be written");
    done += static_cast<std::size_t>(written);
  }
  return static_cast<std::int64_t>(bytes.size());
}

std::string get_mail(int descriptor, std::int64_t size) {
  std::string bytes(static_cast<std::size_t>(size), '\0');
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t got = pread(descriptor, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw system_error("mailbox of the worker: cannot be read");
    if (got == 0) throw std::runtime_error("mailbox of the worker: shorter than announced");
    done += static_cast<std::size_t>(got);
  }
  return bytes;
}

void* map_shared(int descriptor, std::size_t size) {
  void* memory = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  if (memory == MAP_FAILED) throw system_error("shared memory of the worker: cannot be mapped");
  return memory;
}

}  // namespace femxdem
