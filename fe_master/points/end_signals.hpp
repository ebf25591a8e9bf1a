#pragma once

#include <array>
#include <csignal>

namespace femxdem {

/// By these a scheduler or a user asks a run to end; schedulers send SIGUSR1 or SIGUSR2 some time before the end and to
/// every process of a job.
inline constexpr std::array kEndSignals = {SIGTERM, SIGINT, SIGHUP, SIGUSR1, SIGUSR2, SIGXCPU};

/// Rank 0 decides: the other ranks and all workers go on until it lets them go. Programs that this one starts inherit
/// it.
inline void ignore_end_signals() {
  for (const int number : kEndSignals) std::signal(number, SIG_IGN);
}

}  // namespace femxdem
