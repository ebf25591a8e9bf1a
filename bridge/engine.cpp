#include "engine.hpp"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <stdexcept>

namespace py = pybind11;

namespace femxdem {
namespace {

/// Interpreter of Debian's Python, whichever python3 comes first on PATH; signals are left to the worker.
py::scoped_interpreter start_interpreter() {
  PyConfig config;
  PyConfig_InitPythonConfig(&config);
  config.install_signal_handlers = 0;
  config.parse_argv = 0;
  config.inspect =
      1;  // a SystemExit that a hook of a user's script raises must not end the process: see script_exits.py
  PyConfig_SetBytesString(&config, &config.program_name, FEMXDEM_PYTHON);
  return py::scoped_interpreter(&config, 0, nullptr, false);
}

/// The exception's own text; its type in front unless the text is a sentence by convention of the engine.
std::string sentence(py::error_already_set& error) {
  const std::string text = py::str(error.value());
  const std::string type = py::str(error.type().attr("__name__"));
  const bool spoken = !text.empty() && (type == "RuntimeError" || type == "ValueError");
  return spoken ? text : type + (text.empty() ? "" : ": " + text);
}

/// The call's result; Python's exceptions become std::runtime_error.
template <class Call>
auto in_python(Call&& call) {
  try {
    return call();
  } catch (py::error_already_set& error) {
    throw std::runtime_error(sentence(error));
  }
}

/// View of shared memory, not a copy.
template <std::size_t N>
py::array_t<double> view(std::array<double, N>& numbers) {
  return py::array_t<double>(N, numbers.data(), py::capsule(numbers.data(), [](void*) {}));
}

std::string to_json(const py::object& object) { return py::str(py::module_::import("json").attr("dumps")(object)); }

}  // namespace

Engine::Engine(const std::string& name, const std::string& python_path) : interpreter_(start_interpreter()) {
  const auto colon = name.find(':');
  if (colon == std::string::npos)
    throw std::runtime_error("engine '" + name + "': expected module:class, such as volume_element:Engine");
  in_python([&] {
    const py::list fields = py::cast(std::vector<std::string>(kReportFields.begin(), kReportFields.end()));
    const auto beside = std::filesystem::read_symlink("/proc/self/exe").parent_path();  // the modules lie there
    py::module_::import("sys").attr("path").attr("insert")(0, beside.string());
    py::module_::import("sys").attr("path").attr("insert")(0, python_path);
    py::module_ module = py::module_::import(name.substr(0, colon).c_str());
    engine_ = module.attr(name.substr(colon + 1).c_str())(fields);
  });
}

std::string Engine::versions() {
  return in_python([&] { return to_json(engine_.attr("versions")()); });
}

Engine::Template Engine::make_template(const std::string& specification_json) {
  return in_python([&] {
    const py::object specification = py::module_::import("json").attr("loads")(specification_json);
    const py::dict made = engine_.attr("make_template")(specification);
    return Template{py::cast<std::string>(py::bytes(made["state"])), to_json(made["manifest"])};
  });
}

int Engine::add(const std::string& state) {
  return in_python([&] { return py::cast<int>(engine_.attr("add")(py::bytes(state))); });
}

std::string Engine::save(int ve) {
  return in_python([&] { return py::cast<std::string>(py::bytes(engine_.attr("save")(ve))); });
}

template <class... Arguments>
void Engine::call(const char* method, Arguments&&... arguments) {
  in_python([&] { engine_.attr(method)(std::forward<Arguments>(arguments)...); });
}

void Engine::replace(int ve, const std::string& state) { call("replace", ve, py::bytes(state)); }
void Engine::remove(int ve) { call("remove", ve); }
void Engine::write_back(int ve, const std::string& exported) { call("write_back", ve, py::bytes(exported)); }
void Engine::follow_network(int ve) { call("follow_network", ve); }
void Engine::complete_report(int ve, Slot& slot) { call("complete_report", ve, view(slot.report)); }
void Engine::measure(int ve, Slot& slot) {
  call("measure", ve, view(slot.stress), view(slot.report), view(slot.stretch));
}
void Engine::stiffness(int ve, Slot& slot, VeStiffness kind) {
  call("stiffness", ve, view(slot.stiffness), kStiffnessWords.at(static_cast<std::size_t>(kind)));
}

Engine::Export Engine::export_scene(const std::string& state) {
  return in_python([&] {
    const py::object answer = engine_.attr("export_scene")(py::bytes(state));
    const bool covered = py::isinstance<py::bytes>(answer);
    return Export{covered, py::cast<std::string>(answer)};
  });
}

std::string Engine::referee(int ve, std::string_view exported, std::array<double, 9> L, long steps) {
  return in_python([&] {
    const py::bytes bytes(exported.data(), exported.size());
    return py::cast<std::string>(engine_.attr("referee")(ve, bytes, view(L).attr("reshape")(3, 3), py::int_(steps)));
  });
}

VeInfo Engine::info(int ve) {
  return in_python([&] {
    const py::dict info = engine_.attr("info")(ve);
    const auto number = [&](const char* key) { return py::cast<double>(py::float_(info[key])); };
    return VeInfo{number("time_step"), number("time_scale"), number("mean_stress")};
  });
}

void Engine::deform(int ve, Slot& slot) {
  in_python([&] {
    const py::object deform = engine_.attr("deform"), L = view(slot.velocity_gradient).attr("reshape")(3, 3);
    if (slot.sample_every == 0) {
      deform(ve, L, py::int_(slot.steps));
    } else {
      deform(ve, L, py::int_(slot.steps), py::int_(slot.sample_every), slot.late, view(slot.mean_stress));
    }
  });
}

pid_t Engine::fork() {
  PyOS_BeforeFork();
  const pid_t pid = ::fork();
  if (pid == 0)
    PyOS_AfterFork_Child();
  else
    PyOS_AfterFork_Parent();
  return pid;
}

void Engine::flush() {
  in_python([] {
    py::module_::import("sys").attr("stdout").attr("flush")();
    py::module_::import("sys").attr("stderr").attr("flush")();
  });
  std::fflush(nullptr);
}

}  // namespace femxdem
