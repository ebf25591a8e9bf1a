#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "compact_cell.hpp"
#include "straining.hpp"
#include "worker_process.hpp"

namespace femxdem {

/// What YADE made of a scene that the compact cell may take over.
struct ExportedScene {
  bool covered = false;
  std::string bytes;  ///< for CompactCell::from_scene; where it is not covered, the sentence why
};

/// YADE as the judge of compact cells: it exports scenes to them and repeats single trials from their states.
class Referee {
 public:
  /// The worker is kept by reference; its volume elements from index 0 on become the referee's.
  explicit Referee(WorkerProcess& worker) : worker_(worker) {}
  ~Referee();
  Referee(const Referee&) = delete;
  Referee& operator=(const Referee&) = delete;

  /// Throws UserError for a state that YADE cannot read.
  ExportedScene exported(const std::string& state);
  /// A scene that cells of this origin can be written back into; `state` is the one that they were exported from.
  void add_origin(std::uint64_t origin, const std::string& state);
  bool knows(std::uint64_t origin) const;

  /// Repeats a trial in YADE from the committed cell, with the contacts in the order of their spheres: nothing where
  /// YADE ends in the same state to the bit (elsewhere than on x86-64: the same stress within 1e-13), else the sentence
  /// what differs.
  std::optional<std::string> difference(std::uint64_t origin, const CompactCell& committed, const Straining& straining,
                                        const CompactCell& trial);

 private:
  WorkerProcess& worker_;
  std::vector<std::uint64_t> origins_;  ///< in the order of the worker's volume elements
};

}  // namespace femxdem
