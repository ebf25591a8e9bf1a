#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "worker_protocol.hpp"

namespace femxdem {

/// What a worker is started with.
struct WorkerCommand {
  std::filesystem::path executable;              ///< empty: femxdem-worker beside this program, else that of the build
  std::string engine = "volume_element:Engine";  ///< Python module:class, see yade_scripts/protocol.py
  std::filesystem::path python_path;             ///< folder of the engine's module; empty: yade_scripts of the sources
  bool sorted_contacts = false;                  ///< contacts are looped over in the order of their spheres
  double point_timeout = 1800;                   ///< a volume element that works longer on one trial is ended [s]
  double template_timeout = 7200;                ///< the same for a preparation or a user's script [s]
};

/// The worker ended by itself and the committed states went with it.
struct WorkerLost : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Name and number of the signal, or the exit status, of a process that ended: "signal 11 (Segmentation fault)".
std::string describe_wait_status(std::int64_t status);

/// The rank's end of its worker: starts it, sends commands, adopts and reaps its processes.
///
/// To be constructed before MPI_Init. The worker loads its engine meanwhile; the first request waits for it.
class WorkerProcess {
 public:
  /// Throws UserError if the executable is missing, std::system_error if it cannot be started.
  explicit WorkerProcess(WorkerCommand command);
  ~WorkerProcess();
  WorkerProcess(const WorkerProcess&) = delete;
  WorkerProcess& operator=(const WorkerProcess&) = delete;

  /// Sends a command and waits for its reply. A forked child that makes no progress for the time allowed is ended, and
  /// so is a worker that answers nothing for that time without one, or for twice that time.
  /// Throws UserError with the engine's sentence on ReplyKind::error, WorkerLost if the worker is gone.
  Reply request(Command command, std::int64_t a = 0, std::int64_t b = 0, std::string_view mail = {});
  /// Sends a command that has no reply.
  void tell(Command command);
  /// From now on a trial may work so long on one volume element, if that is less than the command's point_timeout [s].
  void be_patient(double seconds) { patience_ = seconds; }
  /// What a reply left in the mailbox.
  std::string mail(const Reply& reply) const;

  Slot& slot(std::size_t index) { return batch_->slots.at(index); }
  /// Volume element that a dead trial was working on.
  std::optional<std::size_t> in_flight() const;
  /// The trial has become the committed process: adopt `pid`, reap the old one.
  void adopt(pid_t pid);

  pid_t pid() const { return pid_; }                    ///< of the committed process
  std::int64_t child() const { return batch_->child; }  ///< of its forked process, 0: none
  /// Proportional set size of the committed process and its child [byte].
  std::uint64_t memory() const;

 private:
  void start();
  void wait_until_ready();
  std::uint32_t send(Command command, std::int64_t a, std::int64_t b, std::string_view mail);
  Reply receive(std::uint32_t number, Command command, double timeout);
  void end_what_is_late(bool reported_nothing);
  std::string lost(const char* how) const;
  void reap();
  void end();

  WorkerCommand command_;
  int socket_ = -1;
  int batch_descriptor_ = -1;
  int mail_descriptor_ = -1;
  Batch* batch_ = nullptr;
  pid_t pid_ = 0;
  std::vector<pid_t> retired_;  ///< former committed processes that still have to be reaped
  std::uint32_t sent_ = 0;
  bool ready_ = false;
  double patience_ = std::numeric_limits<double>::infinity();  ///< [s]
};

}  // namespace femxdem
