#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace femxdem {

using Moment = std::chrono::steady_clock::time_point;

/// From now on one of kEndSignals ends this process at once: without its folder's lock, with status kRunAgain (SIGINT:
/// by the signal). Signals that are ignored already (nohup) stay so.
void end_at_signals();

/// Why a run is to end although there is more to do. From its making on the first of kEndSignals is remembered instead,
/// also when it is gone: a run that has ended keeps its status. A second SIGINT ends the process at once.
class EndRequest {
 public:
  /// `before`: the moment by which the process must have ended, if there is one.
  explicit EndRequest(std::optional<Moment> before);
  EndRequest(const EndRequest&) = delete;
  EndRequest& operator=(const EndRequest&) = delete;

  /// The reason, if there is one: a signal, or fewer than `needed` seconds left.
  std::optional<std::string> reason(double needed) const;
  /// Seconds left; nothing where no moment is given.
  std::optional<double> seconds_left() const;

 private:
  std::optional<Moment> before_;
};

/// Seconds of "90", "MM:SS", "HH:MM:SS" or "D-HH:MM:SS", as schedulers write them. Throws UserError.
double seconds_of(const std::string& duration);

/// When the scheduler ends the job, by what it tells in the environment (Slurm: SLURM_JOB_END_TIME).
std::optional<Moment> end_of_job();

}  // namespace femxdem
