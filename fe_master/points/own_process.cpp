#include "own_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <malloc.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>

namespace femxdem {

std::optional<std::string> what_ends(const std::function<void()>& act) {
  constexpr unsigned kLongest = 1800;  // [s]
  const pid_t child = fork();
  if (child < 0) return std::nullopt;
  if (child == 0) {
    for (const int number : {SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGALRM}) std::signal(number, SIG_DFL);
    alarm(kLongest);
    mallopt(M_PERTURB, 0x5a);  // what would depend on memory that nobody has written shall show here
    if (const int nothing = open("/dev/null", O_WRONLY); nothing >= 0) dup2(nothing, STDERR_FILENO);
    try {
      act();
    } catch (...) {  // it is said by the process that does it for good
    }
    _exit(0);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status)) return fmt::format("signal {}, {}", WTERMSIG(status), strsignal(WTERMSIG(status)));
  if (WEXITSTATUS(status) != 0) return fmt::format("status {}", WEXITSTATUS(status));
  return std::nullopt;
}

}  // namespace femxdem
