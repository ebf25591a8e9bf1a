#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

/// What /proc says of processes.
namespace femxdem::processes {

struct Stat {
  char state = 'X';  ///< R, S, D, Z (zombie), X (gone)
  pid_t parent = 0;
};

inline Stat stat(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  std::string line;
  Stat stat;
  if (!std::getline(file, line)) return stat;
  const auto after_name = line.rfind(')') + 2;
  stat.state = line[after_name];
  stat.parent = static_cast<pid_t>(std::stol(line.substr(after_name + 2)));
  return stat;
}

inline bool alive(pid_t pid) {
  const char state = stat(pid).state;
  return state != 'X' && state != 'Z';
}

/// Waits for a condition, at most `seconds`.
template <class Condition>
bool within(double seconds, Condition condition) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > until) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

/// Number of children of `parent`, in state `state` only if it is given.
inline int children(pid_t parent, char state = 0) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    const Stat child = stat(static_cast<pid_t>(std::stol(name)));
    if (child.parent == parent && child.state != 'X' && (state == 0 || child.state == state)) ++count;
  }
  return count;
}

}  // namespace femxdem::processes
