#pragma once

#include <pybind11/embed.h>
#include <sys/types.h>

#include <array>
#include <string>
#include <string_view>

#include "worker_protocol.hpp"

namespace femxdem {

/// The Python interpreter and the engine that it runs (yade_scripts/protocol.py). One a process.
///
/// Every function throws std::runtime_error with the sentence of the Python exception.
class Engine {
 public:
  /// `name` is module:class, looked for in `python_path` first.
  Engine(const std::string& name, const std::string& python_path);

  struct Template {
    std::string state;
    std::string manifest;  ///< JSON
  };
  std::string versions();  ///< JSON
  Template make_template(const std::string& specification_json);
  int add(const std::string& state);
  void replace(int ve, const std::string& state);
  std::string save(int ve);
  void remove(int ve);
  struct Export {
    bool covered = false;
    std::string bytes;  ///< or the sentence why not
  };
  Export export_scene(const std::string& state);
  void write_back(int ve, const std::string& exported);
  std::string referee(int ve, std::string_view exported, std::array<double, 9> velocity_gradient, long steps);
  VeInfo info(int ve);
  /// Holds the slot's velocity gradient for its number of steps; the mean stress into the slot where it is asked for.
  void deform(int ve, Slot& slot);
  /// Stress, stretch and what judges a trial of the report into the slot.
  void measure(int ve, Slot& slot);
  /// What measure has left NaN of the report.
  void complete_report(int ve, Slot& slot);
  void stiffness(int ve, Slot& slot, VeStiffness kind);
  void follow_network(int ve);

  /// fork() with the interpreter's consent.
  static pid_t fork();
  /// Empties the output buffers of C and Python.
  void flush();

 private:
  template <class... Arguments>
  void call(const char* method, Arguments&&... arguments);

  pybind11::scoped_interpreter interpreter_;
  pybind11::object engine_;
};

}  // namespace femxdem
