#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "compact_block.hpp"
#include "compact_cell.hpp"
#include "contact_network.hpp"
#include "errors.hpp"

/// The compact cell for Python: tests, the referee and scripts; and the relaxed stiffness of a network
/// (contact_loop.py).
namespace py = pybind11;
using femxdem::CompactCell;

namespace {

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

template <std::size_t N>
py::array_t<double> array(const std::array<double, N>& numbers, const std::vector<py::ssize_t>& shape) {
  return py::array_t<double>(shape, numbers.data());
}

std::array<double, 9> tensor(const Numbers& a) {
  if (a.size() != 9) throw femxdem::UserError("a velocity gradient has 3 x 3 numbers");
  std::array<double, 9> numbers;
  std::copy_n(a.data(), 9, numbers.begin());
  return numbers;
}

py::dict report(const CompactCell& cell) {
  const femxdem::PointReport r = cell.report();
  py::dict values;
  for (std::size_t k = 0; k < r.values.size(); ++k)
    values[py::str(std::string(femxdem::kReportFields[k]))] = r.values[k];
  return values;
}

py::dict info(const CompactCell& cell) {
  const femxdem::VeInfo i = cell.info();
  return py::dict(py::arg("time_step") = i.time_step, py::arg("time_scale") = i.time_scale,
                  py::arg("mean_stress") = i.mean_stress);
}

/// Raises RuntimeError with the sentence of a failure.
py::array_t<double> deform(CompactCell& cell, const Numbers& L, long steps, long sample_every, double late) {
  CompactCell::Deformed deformed;
  const auto numbers = tensor(L);
  {
    const py::gil_scoped_release released;
    deformed = cell.deform(numbers, steps, {sample_every, late});
  }
  if (deformed.failure) throw std::runtime_error(*deformed.failure);
  return array(deformed.mean_stress, {3, 3});
}

/// See the docstring below.
Numbers released_stiffness(std::int64_t grains, const Indices& ids, const Numbers& normal, const Numbers& length,
                           const Numbers& kn, const Numbers& kt, double volume) {
  const auto m = ids.shape(0);
  const auto id = ids.unchecked<2>();
  const auto n = normal.unchecked<2>();
  const auto l = length.unchecked<1>(), k = kn.unchecked<1>(), s = kt.unchecked<1>();
  if (m == 0 || n.shape(0) != m || l.shape(0) != m || k.shape(0) != m || s.shape(0) != m)
    throw std::invalid_argument("released_stiffness: one row of every array for each contact");
  std::vector<femxdem::Spring> springs;
  for (py::ssize_t c = 0; c < m; ++c)
    springs.push_back({id(c, 0), id(c, 1), {n(c, 0), n(c, 1), n(c, 2)}, l(c), k(c), s(c)});
  const Eigen::MatrixXd released = femxdem::released_stiffness(grains, springs, volume);  // symmetric to the bit
  return Numbers({6, 6}, released.data());
}

void define_released_stiffness(py::module_& module) {
  module.def(
      "released_stiffness", &released_stiffness, py::arg("grains"), py::arg("ids"), py::arg("normal"),
      py::arg("length"), py::arg("kn"), py::arg("kt"), py::arg("volume"),
      "What the stiffness of a periodic contact network loses when its grains move and spin into equilibrium:\n"
      "(1/V) F^T K^-1 F, (6, 6) [Pa] over the strain components xx, yy, zz, xy, yz, zx (tensor, not engineering),\n"
      "K and F the network's stiffness and loads under a unit strain.\n"
      "ids (m, 2), normal (m, 3) from the first to the second, length (m,) of the branch vectors [m], kn, kt\n"
      "(m,) [N/m], volume [m^3].");
}

}  // namespace

PYBIND11_MODULE(compact_cell, module) {
  py::register_exception<femxdem::UserError>(module, "UserError", PyExc_ValueError);
  py::enum_<femxdem::Kernel>(module, "Kernel")
      .value("baseline", femxdem::Kernel::baseline)
      .value("x86_64_v3", femxdem::Kernel::x86_64_v3)
      .value("x86_64_v4", femxdem::Kernel::x86_64_v4);
  module.def("kernels", &femxdem::kernels, "The kernels that this processor has, slowest first.");
  module.def("use_kernel", &femxdem::use_kernel);
  module.def("kernel_in_use", &femxdem::kernel_in_use);
  define_released_stiffness(module);
  py::class_<CompactCell>(module, "CompactCell", "See bridge/compact_cell.hpp.")
      .def_static("from_scene",
                  [](const py::bytes& exported) { return CompactCell::from_scene(std::string(exported)); })
      .def_static("load", [](const py::bytes& saved) { return CompactCell::load(std::string(saved)); })
      .def("save", [](const CompactCell& c) { return py::bytes(c.save()); })
      .def("to_scene", [](const CompactCell& c) { return py::bytes(c.to_scene()); })
      .def("copy", [](const CompactCell& c) { return CompactCell(c); })
      .def("assign", [](CompactCell& c, const CompactCell& other) { c = other; })
      .def("deform", &deform, py::arg("L"), py::arg("steps"), py::arg("sample_every") = 0, py::arg("late") = 0.0)
      .def("stress",
           [](const CompactCell& c) {
             return array(c.stress(), {3, 3});
           })
      .def("stretch",
           [](const CompactCell& c) {
             return array(c.stretch(), {3, 3});
           })
      .def("stiffness",
           [](const CompactCell& c, const std::string& kind) {
             const auto found = std::find(femxdem::kStiffnessWords.begin(), femxdem::kStiffnessWords.end(), kind);
             if (found == femxdem::kStiffnessWords.end())
               throw std::invalid_argument("no stiffness of the name " + kind);
             return array(c.stiffness(static_cast<femxdem::VeStiffness>(found - femxdem::kStiffnessWords.begin())),
                          {3, 3, 3, 3});
           })
      .def("rest", &CompactCell::rest)
      .def("hold",
           [](CompactCell& c, long steps) {
             if (const auto failure = c.hold(steps)) throw std::runtime_error(*failure);
           })
      .def("flip", &CompactCell::flip)
      .def("follow_network", &CompactCell::follow_network)
      .def("report", &report)
      .def("info", &info)
      .def_property_readonly("memory", &CompactCell::memory)
      .def("__len__", &CompactCell::size);
}
