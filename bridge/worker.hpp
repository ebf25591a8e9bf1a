#pragma once

#include <optional>
#include <string>
#include <vector>

#include "engine.hpp"
#include "worker_protocol.hpp"

namespace femxdem {

/// The process that holds the volume elements of one rank. A fork is the snapshot:
///
///     committed process --fork--> trial process: deforms every VE, writes the responses, waits for the verdict
///           ^                        | commit: it becomes the committed process, the old one is ended
///           |                        | reject: it exits; the committed one never moved
///           +-- every other command
///
/// Where fork is refused or not wanted, the same commands work in one process on saved and restored states.
class Worker {
 public:
  Worker(Engine& engine, Batch& batch, pid_t rank) : engine_(engine), batch_(batch), rank_(rank) {}

  /// Serves commands until quit or until the rank is gone.
  void serve();

 private:
  void answer(const Message& message);
  void forget_states();
  void versions(const Message& message);
  void add(const Message& message);
  void make_template(const Message& message);
  void evaluate(const Message& message);
  void complete_reports(const Message& message);
  void save(const Message& message);
  void load(const Message& message);
  void remove(const Message& message);
  void export_scene(const Message& message);
  void write_back(const Message& message);
  void referee(const Message& message);
  void commit_in_process(const Message& message);
  void reject_in_process();

  /// The trial process: returns only once it has become the committed process.
  void serve_trial(const Message& message, pid_t committed);
  /// The committed process, while its child works: reports its death unless it is orderly.
  void await_child(const Message& message, pid_t child);
  void adopt_trial(const Message& message, pid_t committed);
  void deform_all(std::int64_t stiffness);
  void deform_one(std::size_t index, std::int64_t stiffness);
  void take_snapshot();
  void restore(std::size_t index, const std::string& state);
  /// An engine that fails here ends the process: the rank repeats the trial once, from the committed state.
  void follow_networks() noexcept;
  void refresh(std::size_t index);

  Engine& engine_;
  Batch& batch_;
  pid_t rank_;
  std::vector<int> ves_;               ///< the engine's numbers
  std::vector<std::string> restored_;  ///< what every volume element has just been restored from; empty: unknown
  std::vector<std::string> snapshot_;  ///< committed states while trials run in this process
  bool trial_in_process_ = false;
};

}  // namespace femxdem
