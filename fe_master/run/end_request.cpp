#include "end_request.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <vector>

#include "end_signals.hpp"
#include "errors.hpp"
#include "folder_lock.hpp"

namespace femxdem {
namespace {

std::atomic<int> caught{0};  // a handler of signals finds nothing else
static_assert(std::atomic<int>::is_always_lock_free);

/// Only what is safe in a handler.
void end_now(int number) {
  let_go_of_lock();
  if (number == SIGINT) {
    std::signal(SIGINT, SIG_DFL);
    raise(SIGINT);
  }
  constexpr std::string_view said = "femxdem: told to end; run again\n";
  [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, said.data(), said.size());
  _exit(kRunAgain);
}

void remember(int number) {
  int none = 0;
  if (!caught.compare_exchange_strong(none, number) && none == SIGINT && number == SIGINT) end_now(SIGINT);
}

void handle_with(void (*handler)(int)) {
  for (const int number : kEndSignals) {
    struct sigaction action {
    }, before{};
    sigaction(number, nullptr, &before);
    if (before.sa_handler == SIG_IGN) continue;
    action.sa_handler = handler;
    action.sa_flags = SA_RESTART | SA_NODEFER;
    sigaction(number, &action, nullptr);
  }
}

std::string name_of(int number) {
  const char* abbreviation = sigabbrev_np(number);
  return abbreviation != nullptr ? fmt::format("SIG{}", abbreviation) : fmt::format("signal {}", number);
}

/// Whole numbers between the separators; nothing where there is anything else.
std::vector<double> whole_numbers(std::string_view text) {
  std::vector<double> numbers;
  const char *at = text.data(), *end = at + text.size();
  for (;;) {
    unsigned value = 0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc()) return {};
    numbers.push_back(value);
    if (next == end) return numbers;
    if (*next != ':' && !(*next == '-' && numbers.size() == 1)) return {};
    at = next + 1;
  }
}

}  // namespace

void end_at_signals() { handle_with(end_now); }

EndRequest::EndRequest(std::optional<Moment> before) : before_(before) {
  caught = 0;
  handle_with(remember);
}

std::optional<double> EndRequest::seconds_left() const {
  if (!before_) return std::nullopt;
  return std::chrono::duration<double>(*before_ - Moment::clock::now()).count();
}

std::optional<std::string> EndRequest::reason(double needed) const {
  if (const int number = caught) return name_of(number);
  const std::optional<double> left = seconds_left();
  if (left && *left < needed) return fmt::format("{:.0f} s of its time are left", std::max(0.0, *left));
  return std::nullopt;
}

double seconds_of(const std::string& duration) {
  std::vector<double> parts = whole_numbers(duration);
  const bool with_days = duration.find('-') != std::string::npos;
  const std::size_t most = with_days ? 4 : 3;
  if (parts.empty() || parts.size() > most || (with_days && parts.size() < 2))
    throw UserError(
        fmt::format("--time-limit '{}': is no duration; give seconds, MM:SS, HH:MM:SS or D-HH:MM:SS", duration));
  if (with_days) parts.resize(4, 0);  // D-HH and D-HH:MM, as Slurm reads them
  constexpr std::array<double, 4> kUnits = {1, 60, 3600, 86400};
  double seconds = 0;
  for (std::size_t k = 0; k < parts.size(); ++k) seconds += parts[parts.size() - 1 - k] * kUnits[k];
  return seconds;
}

std::optional<Moment> end_of_job() {
  const char* text = std::getenv("SLURM_JOB_END_TIME");
  long end = 0;
  if (text == nullptr || std::from_chars(text, text + std::strlen(text), end).ec != std::errc()) return std::nullopt;
  const auto left = std::chrono::system_clock::time_point(std::chrono::seconds(end)) - std::chrono::system_clock::now();
  return Moment::clock::now() + std::chrono::duration_cast<Moment::duration>(left);
}

}  // namespace femxdem
