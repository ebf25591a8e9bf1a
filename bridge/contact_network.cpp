#include "contact_network.hpp"

#include <Eigen/CholmodSupport>
#include <Eigen/Geometry>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace femxdem {
namespace {

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

  void add(const Spring& s) {
    const auto& [i, j, n, length, kn, kt] = s;
    const Eigen::Matrix3d spring = kt * Eigen::Matrix3d::Identity() + (kn - kt) * n * n.transpose();
    const Block B = relative_displacement(n);
    const Eigen::Matrix<double, 12, 3> force = B.transpose() * spring;
    const Eigen::Matrix<double, 12, 12> K = force * B;
    const auto row = [&s](int a) { return 6 * (a < 6 ? s.i : s.j) + a % 6; };
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

/// Place of the strain component (i, j) in kStrains.
constexpr std::array<std::array<int, 3>, 3> kPlace = {{{0, 3, 5}, {3, 1, 4}, {5, 4, 2}}};

constexpr int kIterations = 60;  ///< of the power iteration

}  // namespace

std::array<double, 81> affine_stiffness(std::span<const Spring> springs, double volume) {
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix3d G = Eigen::Matrix3d::Zero();
  for (const Spring& s : springs) {
    const double l2 = s.length * s.length / volume;
    Eigen::Matrix<double, 6, 1> nn;
    for (int a = 0; a < 6; ++a) {
      const auto [k, l] = kStrains[static_cast<std::size_t>(a)];
      nn[a] = s.normal[k] * s.normal[l];
    }
    normal += ((s.kn - s.kt) * l2) * nn * nn.transpose();
    G += (0.25 * s.kt * l2) * s.normal * s.normal.transpose();
  }
  std::array<double, 81> C{};
  const auto place = [](int i, int j) { return kPlace[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)]; };
  std::size_t at = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k)
        for (int l = 0; l < 3; ++l)
          C[at++] = normal(place(i, j), place(k, l)) + (i == k) * G(j, l) + (i == l) * G(j, k) + (j == k) * G(i, l) +
                    (j == l) * G(i, k);
  return C;
}

Eigen::MatrixXd released_stiffness(std::int64_t grains, std::span<const Spring> springs, double volume) {
  Network network(grains, springs.size());
  for (const Spring& s : springs) {
    if (s.i < 0 || s.i >= grains || s.j < 0 || s.j >= grains)
      throw std::invalid_argument("released_stiffness: a contact of a grain that is not there");
    network.add(s);
  }
  const Eigen::MatrixXd energy = network.released_energy() / volume;
  return 0.5 * (energy + energy.transpose());
}

std::array<double, 81> relaxed_stiffness(std::int64_t grains, std::span<const Spring> springs, double volume) {
  std::array<double, 81> C = affine_stiffness(springs, volume);
  const Eigen::MatrixXd released = released_stiffness(grains, springs, volume);
  for (std::size_t at = 0; at < 81; ++at) C[at] -= released(kPlace[at / 27][at / 9 % 3], kPlace[at / 3 % 3][at % 3]);
  return C;
}

double critical_time_step(std::span<const NetworkGrain> grains, std::span<const Spring> springs,
                          std::span<const double> start) {
  using Rows = Eigen::Matrix<double, 3, Eigen::Dynamic>;
  const auto n = static_cast<Eigen::Index>(grains.size());
  Rows u = Eigen::Map<const Rows>(start.data(), 3, n), w = Eigen::Map<const Rows>(start.data() + 3 * n, 3, n);
  double omega2 = 0;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Rows force = Rows::Zero(3, n), torque = Rows::Zero(3, n);
    for (const Spring& s : springs) {
      const double ri = grains[static_cast<std::size_t>(s.i)].radius, rj = grains[static_cast<std::size_t>(s.j)].radius;
      const Eigen::Vector3d spin = ri * w.col(s.i) + rj * w.col(s.j);
      const Eigen::Vector3d d = u.col(s.j) - u.col(s.i) - spin.cross(s.normal);
      const Eigen::Vector3d along = d.dot(s.normal) * s.normal, f = s.kn * along + s.kt * (d - along);
      const Eigen::Vector3d t = s.normal.cross(f);
      force.col(s.j) += f, force.col(s.i) -= f;
      torque.col(s.i) -= ri * t, torque.col(s.j) -= rj * t;
    }
    double kinetic = 0;
    for (Eigen::Index g = 0; g < n; ++g) {
      const NetworkGrain& grain = grains[static_cast<std::size_t>(g)];
      kinetic += grain.mass * u.col(g).squaredNorm() + grain.inertia * w.col(g).squaredNorm();
    }
    omega2 = (u.cwiseProduct(force).sum() + w.cwiseProduct(torque).sum()) / kinetic;  // Rayleigh's quotient
    for (Eigen::Index g = 0; g < n; ++g) {
      u.col(g) = force.col(g) / grains[static_cast<std::size_t>(g)].mass;
      w.col(g) = torque.col(g) / grains[static_cast<std::size_t>(g)].inertia;
    }
    const double size = u.norm();
    u /= size, w /= size;
  }
  return 2 / std::sqrt(omega2);
}

}  // namespace femxdem
