#include "compact_report.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "compact_step.hpp"

namespace femxdem {
namespace {

using Vector = std::array<double, 3>;

double norm(const Vector& a) { return std::sqrt(a[0] * a[0] + (a[1] * a[1] + a[2] * a[2])); }

double norm(const Row3& a) {
  double sum = 0;
  for (const double number : a) sum += number * number;
  return std::sqrt(sum);
}

Vector at(const std::array<double*, 3>& arrays, std::size_t c) { return {arrays[0][c], arrays[1][c], arrays[2][c]}; }

/// Centre of the first sphere seen from that of the second [m].
Vector branch(const CompactArrays& a, std::size_t c) {
  const Row3& H = a.header->H;
  const auto &xi = a.spheres[a.i[c]].x, &xj = a.spheres[a.j[c]].x;
  const double p = unpack_shift(a.shift[c], 0), q = unpack_shift(a.shift[c], 1), r = unpack_shift(a.shift[c], 2);
  Vector b;
  for (std::size_t k = 0; k < 3; ++k) b[k] = (xi[k] - xj[k]) - (H[3 * k] * p + (H[3 * k + 1] * q + H[3 * k + 2] * r));
  return b;
}

/// Normal and shear force, as they act on the second sphere [N].
Vector force(const CompactArrays& a, std::size_t c) {
  Vector f;
  for (std::size_t k = 0; k < 3; ++k) f[k] = a.normal_force[c] * a.normal[k][c] + a.shear[k][c];
  return f;
}

/// Mean resultant on a sphere over mean contact force.
double unbalanced_force(const CompactArrays& a) {
  const CompactHeader& h = *a.header;
  double resultants = 0, forces = 0;
  for (std::size_t s = 0; s < h.spheres; ++s) resultants += norm(a.spheres[s].f);
  for (std::size_t c = 0; c < h.contacts; ++c) forces += norm(force(a, c));
  return resultants / h.spheres / (forces / std::max(h.contacts, 1U));
}

/// Whether the shear force is at the limit of its law, within 1e-6 of it (contact_loop.at_coulomb_limit).
bool slides(const CompactArrays& a, std::size_t c) {
  const CompactClass& kind = a.classes[a.class_of[c]];
  double limit = kind.tangent * std::abs(a.normal_force[c]);
  if (a.header->law == CompactLaw::cohesive) {
    const double overlap = a.spheres[a.i[c]].radius + a.spheres[a.j[c]].radius - norm(branch(a, c));
    limit = std::max(kind.shear_adhesion + kind.tangent * (a.kn[c] * (overlap - a.unp[c])), 0.0);
  }
  if (a.header->law == CompactLaw::paper) limit = kind.tangent * (a.normal_force[c] + kind.normal_adhesion);
  return norm(at(a.shear, c)) >= (1 - 1e-6) * limit;
}

/// Contacts of each sphere.
std::vector<int> contacts_of_spheres(const CompactArrays& a) {
  std::vector<int> count(a.header->spheres, 0);
  for (std::size_t c = 0; c < a.header->contacts; ++c) ++count[a.i[c]], ++count[a.j[c]];
  return count;
}

/// Mean number of contacts of the spheres that have more than one.
double coordination_of_backbone(const CompactArrays& a) {
  long spheres = 0, contacts = 0;
  for (const int count : contacts_of_spheres(a)) {
    if (count < 2) continue;
    ++spheres;
    contacts += count;
  }
  return spheres > 0 ? static_cast<double>(contacts) / static_cast<double>(spheres) : 0.0;
}

/// Mean n_i n_j in the order xx, yy, zz, xy, yz, zx.
std::array<double, 6> fabric(const CompactArrays& a) {
  std::array<double, 6> sum{};
  for (std::size_t c = 0; c < a.header->contacts; ++c) {
    const Vector n = at(a.normal, c);
    for (std::size_t k = 0; k < 3; ++k) {
      sum[k] += n[k] * n[k];
      sum[3 + k] += n[k] * n[(k + 1) % 3];
    }
  }
  for (double& entry : sum) entry /= std::max(a.header->contacts, 1U);
  return sum;
}

double mean_rotation(const CompactArrays& a) {
  double sum = 0;
  const auto& q = a.turned;
  for (std::size_t s = 0; s < a.header->spheres; ++s)
    sum += 2 * std::atan2(norm(Vector{q[1][s], q[2][s], q[3][s]}), std::abs(q[0][s]));
  return sum / a.header->spheres;
}

void report_network(const CompactArrays& a, PointReport& r) {
  const double m = a.header->contacts;
  r["coordination_backbone"] = coordination_of_backbone(a);
  const std::array<double, 6> F = fabric(a);
  std::size_t k = 0;
  for (const char* name : {"fabric_xx", "fabric_yy", "fabric_zz", "fabric_xy", "fabric_yz", "fabric_zx"})
    r[name] = F[k++];
  double sliding = 0, adhesive = 0;
  for (std::size_t c = 0; c < a.header->contacts; ++c) {
    const CompactClass& kind = a.classes[a.class_of[c]];
    sliding += slides(a, c);
    adhesive += kind.normal_adhesion > 0 && kind.broken == 0;
  }
  r["sliding_contacts"] = sliding / std::max(m, 1.0);
  r["adhesive_contacts"] = adhesive / std::max(m, 1.0);
}

}  // namespace

Row3 love_weber(const CompactArrays& a) {
  Row3 sum{};
  for (std::size_t c = 0; c < a.header->contacts; ++c) {
    const Vector f = force(a, c), b = branch(a, c);
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t k = 0; k < 3; ++k) sum[3 * r + k] += f[r] * b[k];
  }
  const double volume = determinant(a.header->H);
  for (double& entry : sum) entry /= volume;
  return sum;
}

Row3 symmetrised(const Row3& s) {
  Row3 t;
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t k = 0; k < 3; ++k) t[3 * r + k] = 0.5 * (s[3 * r + k] + s[3 * k + r]);
  return t;
}

double pressure(const Row3& s) { return -(s[0] + s[4] + s[8]) / 3; }

double time_scale(const CompactHeader& h, double pressure) {
  return pressure > 0 ? h.mean_diameter * std::sqrt(h.density / pressure) : std::numeric_limits<double>::infinity();
}

PointReport trial_report(const CompactArrays& a, const CompactTrial& trial) {
  const CompactHeader& h = *a.header;
  PointReport r;
  r.values.fill(std::numeric_limits<double>::quiet_NaN());
  const Row3 s = love_weber(a);
  Row3 skew;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t k = 0; k < 3; ++k) skew[3 * i + k] = s[3 * i + k] - s[3 * k + i];
  r["contacts"] = h.contacts;
  r["coordination"] = 2.0 * h.contacts / h.spheres;
  r["stress_asymmetry"] = norm(skew) / std::max(2 * norm(s), 1e-300);
  const Row3 end = symmetrised(s);
  r["end_stress_xx"] = end[0], r["end_stress_yy"] = end[4], r["end_stress_zz"] = end[8];
  r["end_stress_xy"] = end[1], r["end_stress_yz"] = end[5], r["end_stress_zx"] = end[6];
  r["inertial_number"] = trial.rate * time_scale(h, pressure(s));
  r["unbalanced_force"] = unbalanced_force(a);
  r["porosity"] = 1 - h.solid_volume / determinant(h.H);
  r["time_step"] = h.time_step;
  r["dem_steps"] = trial.steps;
  r["seconds"] = r["engine_seconds"] = trial.seconds;
  return r;
}

void complete_report(const CompactArrays& a, const CompactTrial& trial, PointReport& r) {
  r["dem_steps"] = trial.steps;
  r["seconds"] = r["engine_seconds"] = trial.seconds;
  report_network(a, r);
  r["mean_rotation"] = mean_rotation(a);
}

std::vector<Spring> springs(const CompactArrays& a, VeStiffness kind) {
  const bool reduced = kind == VeStiffness::reduced;
  std::vector<Spring> all;
  all.reserve(a.header->contacts);
  for (std::size_t c = 0; c < a.header->contacts; ++c) {
    const Eigen::Vector3d normal(a.normal[0][c], a.normal[1][c], a.normal[2][c]);
    const double kt = kind == VeStiffness::sliding && slides(a, c) ? 0 : a.ks[c];
    all.push_back({a.i[c], a.j[c], normal, norm(branch(a, c)), (reduced ? kReducedNormal : 1) * a.kn[c],
                   (reduced ? kReducedTangent : 1) * kt});
  }
  return all;
}

}  // namespace femxdem
