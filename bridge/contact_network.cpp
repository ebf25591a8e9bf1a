#include <pybind11/numpy.h>

#include <Eigen/CholmodSupport>
#include <array>
#include <stdexcept>
#include <vector>

/// The relaxed elastic stiffness of a contact network, for the Python side (yade_scripts/contact_loop.py).
namespace py = pybind11;

namespace {

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;
using Block = Eigen::Matrix<double, 3, 12>;  ///< relative displacement at a contact over (u_i, w_i, u_j, w_j)

constexpr std::array<std::array<int, 2>, 6> kStrains = {{{0, 0}, {1, 1}, {2, 2}, {0, 1}, {1, 2}, {2, 0}}};

/// Springs to the ground of every displacement, over the mean contact stiffness: they hold the network's rigid
/// translation, grains without contact and mechanisms. No load acts on any of these, so nothing else notices.
constexpr double kGround = 1e-9;

Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
  return Eigen::Matrix3d{{0, -a.z(), a.y()}, {a.z(), 0, -a.x()}, {-a.y(), a.x(), 0}};
}

/// d = u_j - u_i - (r_i theta_i + r_j theta_j) x n, with w = r theta.
Block relative_displacement(const Eigen::Vector3d& n) {
  Block B;
  B << -Eigen::Matrix3d::Identity(), skew(n), Eigen::Matrix3d::Identity(), skew(n);
  return B;
}

/// The network in equilibrium under unit strains: K q + F = 0.
class Network {
 public:
  Network(Eigen::Index grains, std::size_t contacts) : loads_(Eigen::MatrixXd::Zero(6 * grains, 6)), size_(6 * grains) {
    entries_.reserve(78 * contacts + static_cast<std::size_t>(size_));
  }

  void add(std::int64_t i, std::int64_t j, const Eigen::Vector3d& n, double length, double kn, double kt) {
    const Eigen::Matrix3d spring = kt * Eigen::Matrix3d::Identity() + (kn - kt) * n * n.transpose();
    const Block B = relative_displacement(n);
    const Eigen::Matrix<double, 12, 3> force = B.transpose() * spring;
    const Eigen::Matrix<double, 12, 12> K = force * B;
    const auto row = [&](int a) { return 6 * (a < 6 ? i : j) + a % 6; };
    for (int a = 0; a < 12; ++a) {
      for (int b = 0; b < 12; ++b)
        if (row(a) >= row(b)) entries_.emplace_back(row(a), row(b), K(a, b));
    }
    for (int e = 0; e < 6; ++e) {
      const auto [k, l] = kStrains[static_cast<std::size_t>(e)];
      Eigen::Vector3d stretch = Eigen::Vector3d::Zero();  // E l of the unit strain (e_k e_l + e_l e_k) / 2
      stretch[k] += 0.5 * length * n[l];
      stretch[l] += 0.5 * length * n[k];
      const Eigen::Matrix<double, 12, 1> load = force * stretch;
      for (int a = 0; a < 12; ++a) loads_(row(a), e) += load[a];
    }
    stiffness_ += kn;
    ++contacts_;
  }

  /// F^T K^-1 F, 6 x 6 in the order of kStrains [N m].
  Eigen::MatrixXd released_energy() {
    const double ground = kGround * stiffness_ / static_cast<double>(contacts_);
    for (Eigen::Index a = 0; a < size_; ++a) entries_.emplace_back(a, a, ground);
    Eigen::SparseMatrix<double> K(size_, size_);
    K.setFromTriplets(entries_.begin(), entries_.end());
    const Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>, Eigen::Lower> factor(K);
    if (factor.info() != Eigen::Success) throw std::runtime_error("the stiffness of the contact network is indefinite");
    return loads_.transpose() * factor.solve(loads_);
  }

 private:
  std::vector<Eigen::Triplet<double>> entries_;
  Eigen::MatrixXd loads_;  ///< on (u, w) of every grain for each unit strain [N]
  Eigen::Index size_;
  double stiffness_ = 0;
  std::size_t contacts_ = 0;
};

/// See the docstring below.
Numbers released_stiffness(std::int64_t grains, const Indices& ids, const Numbers& normal, const Numbers& length,
                           const Numbers& kn, const Numbers& kt, double volume) {
  const auto m = ids.shape(0);
  const auto id = ids.unchecked<2>();
  const auto n = normal.unchecked<2>();
  const auto l = length.unchecked<1>(), k = kn.unchecked<1>(), s = kt.unchecked<1>();
  if (m == 0 || n.shape(0) != m || l.shape(0) != m || k.shape(0) != m || s.shape(0) != m)
    throw std::invalid_argument("released_stiffness: one row of every array for each contact");
  Network network(grains, static_cast<std::size_t>(m));
  for (py::ssize_t c = 0; c < m; ++c) {
    if (id(c, 0) < 0 || id(c, 0) >= grains || id(c, 1) < 0 || id(c, 1) >= grains)
      throw std::invalid_argument("released_stiffness: a contact of a grain that is not there");
    network.add(id(c, 0), id(c, 1), Eigen::Vector3d(n(c, 0), n(c, 1), n(c, 2)), l(c), k(c), s(c));
  }
  const Eigen::MatrixXd energy = network.released_energy() / volume;
  Numbers result({6, 6});
  auto out = result.mutable_unchecked<2>();
  for (int a = 0; a < 6; ++a)
    for (int b = 0; b < 6; ++b) out(a, b) = 0.5 * (energy(a, b) + energy(b, a));
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
