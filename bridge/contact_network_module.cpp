#include <pybind11/numpy.h>

#include <stdexcept>
#include <vector>

#include "contact_network.hpp"

/// The relaxed elastic stiffness of a contact network, for the Python side (yade_scripts/contact_loop.py).
namespace py = pybind11;

namespace {

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

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
  const Eigen::MatrixXd released = femxdem::released_stiffness(grains, springs, volume);
  Numbers result({6, 6});
  auto out = result.mutable_unchecked<2>();
  for (int a = 0; a < 6; ++a)
    for (int b = 0; b < 6; ++b) out(a, b) = released(a, b);
  return result;
}

}  // namespace

PYBIND11_MODULE(contact_network, module) {
  module.def(
      "released_stiffness", &released_stiffness, py::arg("grains"), py::arg("ids"), py::arg("normal"),
      py::arg("length"), py::arg("kn"), py::arg("kt"), py::arg("volume"),
      "What the stiffness of a periodic contact network loses when its grains move and spin into equilibrium:\n"
      "(1/V) F^T K^-1 F, (6, 6) [Pa] over the strain components xx, yy, zz, xy, yz, zx (tensor, not engineering),\n"
      "K and F the network's stiffness and loads under a unit strain.\n"
      "ids (m, 2), normal (m, 3) from the first to the second, length (m,) of the branch vectors [m], kn, kt\n"
      "(m,) [N/m], volume [m^3].");
}
