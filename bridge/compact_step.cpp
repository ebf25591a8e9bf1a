#include "compact_step.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "compact_kernel.hpp"

namespace femxdem {
namespace {

constexpr int kEvery = 4;  ///< DEM steps between two looks for contacts that become adhesive (contact_laws.py)

Row3 scaled(double s, const Row3& A) {
  Row3 B;
  for (std::size_t k = 0; k < 9; ++k) B[k] = s * A[k];
  return B;
}

Row3 sum(const Row3& A, const Row3& B) {
  Row3 C;
  for (std::size_t k = 0; k < 9; ++k) C[k] = A[k] + B[k];
  return C;
}

/// How far the cell has come since the list was made: Frobenius norm of F - I.
double distortion(const Row3& F) {
  double e2 = 0;
  for (std::size_t k = 0; k < 9; ++k) {
    const double e = F[k] - (k % 4 == 0 ? 1.0 : 0.0);
    e2 += e * e;
  }
  return std::sqrt(e2);
}

/// The integrator with the cell's own step; returns how far spheres have come from the list's places, beyond the cell's
/// deformation, and how much wider gaps may have closed [m].
double move(CompactHeader& h, const CompactArrays& a, Row3& G) {
  CompactMotion m;
  m.dt = h.time_step, m.damping = h.damping, m.previous_L = h.previous_L;
  for (std::size_t k = 0; k < 9; ++k) m.change[k] = h.L[k] - h.previous_L[k];
  const Row3& d = m.change;
  m.spin = {-(0.5 * (d[5] - d[7])), 0.5 * (d[2] - d[6]), -(0.5 * (d[1] - d[3]))};
  const Row3 increment = scaled(h.time_step, h.L);
  G = product(h.L, h.H);
  h.trsf = sum(h.trsf, product(increment, h.trsf));
  h.H = sum(h.H, product(increment, h.H));
  m.since_list = product(h.H, inverse(h.list_H));
  const double farthest = std::sqrt(compact_loops().integrate(a, m));
  h.previous_L = h.L;
  return 2 * farthest + distortion(m.since_list) * (2 * h.max_radius + h.skin);
}

/// New contacts get their adhesion, those of every step since the last look (contact_laws.run).
void age_new_contacts(CompactHeader& h, const CompactArrays& a) {
  if (h.new_contacts == 0 || h.iteration % kEvery != 0) return;
  for (std::uint32_t c = 0; c < h.contacts; ++c) {
    const double aged = a.classes[a.class_of[c]].when_aged;
    if (aged < 0) continue;
    a.class_of[c] = static_cast<std::uint32_t>(aged);
    a.unp[c] = a.classes[a.class_of[c]].normal_adhesion / a.kn[c];
  }
  h.new_contacts = 0;
}

bool touch(const CompactHeader& h, const CompactArrays& a, const CompactPair& p) {
  const CompactSphere &i = a.spheres[p.i], &j = a.spheres[p.j];
  std::array<double, 3> d;
  const double c0 = unpack_shift(p.shift, 0), c1 = unpack_shift(p.shift, 1), c2 = unpack_shift(p.shift, 2);
  for (std::size_t k = 0; k < 3; ++k)
    d[k] = (j.x[k] + (h.H[3 * k] * c0 + (h.H[3 * k + 1] * c1 + h.H[3 * k + 2] * c2))) - i.x[k];
  const double r = i.radius + j.radius;
  return r * r - (d[0] * d[0] + (d[1] * d[1] + d[2] * d[2])) >= 0;
}

/// Both stiffnesses in the order in which YADE's Ip2 functors multiply; or the constants of a MatchMaker.
void set_stiffness(const CompactArrays& a, std::uint32_t c, const CompactPair& p) {
  const double Ea = a.young[p.i], Eb = a.young[p.j], Va = a.poisson[p.i], Vb = a.poisson[p.j];
  const double Da = a.spheres[p.i].radius, Db = a.spheres[p.j].radius;
  if (!std::isnan(a.header->constant_kn)) {
    a.kn[c] = a.header->constant_kn;
    a.ks[c] = a.header->constant_ks;
    return;
  }
  a.kn[c] = 2 * Ea * Da * Eb * Db / (Ea * Da + Eb * Db);
  a.ks[c] = Va != 0 && Vb != 0 ? 2 * Ea * Da * Va * Eb * Db * Vb / (Ea * Da * Va + Eb * Db * Vb) : 0;
}

/// Makes the pair a contact, in its place among the others.
void insert_contact(CompactBlock& block, const CompactPair& p) {
  CompactHeader* h = &block.header();
  if (h->contacts == h->contact_capacity) {
    block.grow(h->contacts + h->contacts / 8 + 64, 0);
    h = &block.header();
  }
  const CompactArrays& a = block.arrays();
  std::uint32_t at = static_cast<std::uint32_t>(std::lower_bound(a.i, a.i + h->contacts, p.i) - a.i);
  while (at < h->contacts && a.i[at] == p.i && a.j[at] < p.j) ++at;
  for_each_contact_array(
      a, [&](auto* array) { std::copy_backward(array + at, array + h->contacts, array + h->contacts + 1); });
  ++h->contacts;
  a.i[at] = p.i, a.j[at] = p.j, a.shift[at] = p.shift;
  a.class_of[at] = class_of_new(a, std::min(a.tangent[p.i], a.tangent[p.j]));
  if (a.classes[a.class_of[at]].when_aged >= 0) ++h->new_contacts;
  set_stiffness(a, at, p);
  const double adhesion = h->law == CompactLaw::paper ? a.classes[a.class_of[at]].normal_adhesion : 0;
  a.unp[at] = adhesion > 0 ? adhesion / a.kn[at] : 0;
  a.normal_force[at] = 0;
  for (std::size_t k = 0; k < 3; ++k) a.shear[k][at] = a.normal[k][at] = 0;
}

/// Pairs within `reach` are looked at, those that touch become contacts.
void find_contacts(CompactBlock& block, double reach) {
  std::uint32_t p = block.header().pairs;
  while (p > 0 && block.arrays().pairs[p - 1].gap <= reach) {
    --p;
    CompactHeader& h = block.header();
    CompactPair* pairs = block.arrays().pairs;
    if (!touch(h, block.arrays(), pairs[p])) continue;
    const CompactPair found = pairs[p];
    std::copy(pairs + p + 1, pairs + h.pairs, pairs + p);
    --h.pairs;
    insert_contact(block, found);
  }
}

/// Contacts that have come to their end become pairs again.
void remove_contacts(CompactBlock& block, const std::uint32_t* lost, std::size_t count) {
  if (count == 0) return;
  if (block.header().pairs + count > block.header().pair_capacity) {
    const std::size_t pairs = block.header().pairs + count;
    block.grow(0, pairs + pairs / 8 + 64);
  }
  CompactHeader& h = block.header();
  const CompactArrays& a = block.arrays();
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint32_t c = lost[k];
    a.pairs[h.pairs++] = {a.i[c], a.j[c], a.shift[c], std::numeric_limits<float>::lowest()};
    if (a.classes[a.class_of[c]].when_aged >= 0) --h.new_contacts;
  }
  for_each_contact_array(a, [&](auto* array) {
    std::uint32_t to = lost[0];
    for (std::size_t k = 0; k < count; ++k) {
      const std::uint32_t from = lost[k] + 1, end = k + 1 < count ? lost[k + 1] : h.contacts;
      std::copy(array + from, array + end, array + to);
      to += end - from;
    }
  });
  h.contacts -= static_cast<std::uint32_t>(count);
}

/// Forces of all contacts, those of this block's law, after `time` [s] of the slip that goes on.
void contact_forces(CompactBlock& block, double time, const Row3& G) {
  const CompactHeader& h = block.header();
  const CompactCellMotion cell{time, h.H, G};
  static thread_local std::vector<std::uint32_t> lost;
  if (lost.size() < h.contacts) lost.resize(h.contacts + h.contacts / 4);
  const CompactLoops& loops = compact_loops();
  const auto contacts = h.law == CompactLaw::cohesive   ? loops.cohesive
                        : h.law == CompactLaw::friction ? loops.friction
                                                        : loops.paper;
  remove_contacts(block, lost.data(), contacts(block.arrays(), cell, lost.data()));
}

}  // namespace

Row3 product(const Row3& A, const Row3& B) {
  Row3 C;
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c)
      C[3 * r + c] = A[3 * r] * B[c] + (A[3 * r + 1] * B[3 + c] + A[3 * r + 2] * B[6 + c]);
  return C;
}

double determinant(const Row3& A) {
  const auto part = [&](std::size_t a, std::size_t b, std::size_t c) {
    return A[a] * (A[3 + b] * A[6 + c] - A[3 + c] * A[6 + b]);
  };
  return part(0, 1, 2) - part(1, 0, 2) + part(2, 0, 1);
}

Row3 inverse(const Row3& A) {
  Row3 B;
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
      B[3 * c + r] = A[3 * r1 + c1] * A[3 * r2 + c2] - A[3 * r1 + c2] * A[3 * r2 + c1];
    }
  }
  return scaled(1 / (A[0] * B[0] + A[1] * B[3] + A[2] * B[6]), B);
}

std::uint32_t class_of_new(const CompactArrays& a, double tangent) {
  for (std::uint32_t k = 0; k < a.header->classes; ++k)
    if (a.classes[k].for_new != 0 && a.classes[k].tangent == tangent) return k;
  return 0;
}

void step(CompactBlock& block) {
  flip(block);
  Row3 G;
  const double reach = move(block.header(), block.arrays(), G);
  ++block.header().iteration;
  age_new_contacts(block.header(), block.arrays());
  if (block.header().skin < reach) {
    make_list(block);
    find_contacts(block, 0.0);
  } else {
    find_contacts(block, reach);
  }
  contact_forces(block, block.header().time_step, G);
}

void find_forces(CompactBlock& block) {
  const CompactArrays& a = block.arrays();
  for (std::uint32_t s = 0; s < a.header->spheres; ++s) a.spheres[s].f = a.spheres[s].t = {};
  contact_forces(block, 0, product(a.header->previous_L, a.header->H));
}

void rest(CompactBlock& block) {
  const CompactArrays& a = block.arrays();
  for (std::uint32_t s = 0; s < a.header->spheres; ++s) a.spheres[s].v = a.spheres[s].w = {};
  a.header->L = a.header->previous_L = {};
  find_forces(block);
}

}  // namespace femxdem
