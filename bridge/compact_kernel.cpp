#include "compact_kernel.hpp"

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include "compact_cell.hpp"
#include "compact_lanes.hpp"
#include "errors.hpp"

/// The step's loops over W spheres or contacts at once, written with the compiler's vectors and compiled for every
/// processor level. Sums are a0 b0 + (a1 b1 + a2 b2), divisions true, nothing is fused: equal bits for every W.
namespace femxdem {
namespace {

constexpr int kNumbers = sizeof(CompactSphere) / sizeof(double);  ///< of a sphere
constexpr int kForce = 10;                                        ///< the first of its force, then its torque

/// The numbers of W spheres, number by number.
template <int W>
struct Spheres {
  Vec<W> numbers[kNumbers];

  template <class Where>
  FEMXDEM_INLINE void gather(const CompactSphere* spheres, Where where) {
    repeat<kNumbers / W>([&](auto part) FEMXDEM_LAMBDA {
      constexpr int chunk = W * part;
      repeat<W>([&](auto k) FEMXDEM_LAMBDA {
        numbers[chunk + k] = load<Vec<W>>(reinterpret_cast<const double*>(spheres + where(k)) + chunk);
      });
      transpose<W>(numbers + chunk);
    });
  }
  FEMXDEM_INLINE void write(CompactSphere* to) {
    repeat<kNumbers / W>([&](auto part) FEMXDEM_LAMBDA {
      constexpr int chunk = W * part;
      transpose<W>(numbers + chunk);
      repeat<W>([&](auto k) FEMXDEM_LAMBDA { store(reinterpret_cast<double*>(to + k) + chunk, numbers[chunk + k]); });
    });
  }
  FEMXDEM_INLINE Vec3<W> at(int k) const { return {numbers[k], numbers[k + 1], numbers[k + 2]}; }
  FEMXDEM_INLINE void set(int k, const Vec3<W>& a) { numbers[k] = a.x, numbers[k + 1] = a.y, numbers[k + 2] = a.z; }
  FEMXDEM_INLINE Vec3<W> x() const { return at(0); }
  FEMXDEM_INLINE Vec3<W> v() const { return at(3); }
  FEMXDEM_INLINE Vec3<W> w() const { return at(6); }
  FEMXDEM_INLINE Vec<W> radius() const { return numbers[9]; }
  FEMXDEM_INLINE Vec3<W> f() const { return at(kForce); }
  FEMXDEM_INLINE Vec3<W> t() const { return at(kForce + 3); }
};

/// Cundall's non-viscous damping: a (1 - damping sign(a (v + dt a / 2))).
template <int W>
FEMXDEM_INLINE Vec<W> damped(Vec<W> a, Vec<W> v, double dt, double damping) {
  const Vec<W> power = a * (v + (0.5 * dt) * a);
  const Vec<W> one = splat<W>(1.0);
  return a * (power > 0.0 ? splat<W>(1.0 - damping) : power < 0.0 ? splat<W>(1.0 + damping) : one);
}

/// q <- (cos h, sin(h) w/|w|) q, h = |w| dt/2, normalised; by series, whose error is below round-off for h < 0.1.
template <int W>
FEMXDEM_INLINE void turn(const std::array<double*, 4>& turned, std::size_t at, const Vec3<W>& w, double dt) {
  const Vec<W> h2 = (0.25 * dt * dt) * dot(w, w);
  const Vec<W> c = 1.0 - h2 * (1.0 / 2 - h2 * (1.0 / 24 - h2 * (1.0 / 720 - h2 * (1.0 / 40320 - h2 / 3628800))));
  const Vec<W> s = (0.5 * dt) * (1.0 - h2 * (1.0 / 6 - h2 * (1.0 / 120 - h2 * (1.0 / 5040 - h2 / 362880))));
  const Vec3<W> p = scaled<W>(s, w);
  const Vec<W> qw = load<Vec<W>>(turned[0] + at);
  const Vec3<W> q = load3<W>({turned[1], turned[2], turned[3]}, at);
  const Vec<W> rw = c * qw - dot(p, q);
  const Vec3<W> r = scaled<W>(c, q) + scaled<W>(qw, p) + cross(p, q);
  const Vec<W> length = square_root(rw * rw + dot(r, r));
  store(turned[0] + at, rw / length);
  store3<W>({turned[1], turned[2], turned[3]}, at, Vec3<W>{r.x / length, r.y / length, r.z / length});
}

template <int W>
FEMXDEM_INLINE double integrate(const CompactArrays& a, const CompactMotion& m) {
  Vec<W> farthest{};
  const auto damp = [&](const Vec3<W>& b, const Vec3<W>& v) FEMXDEM_LAMBDA {
    return Vec3<W>{damped<W>(b.x, v.x, m.dt, m.damping), damped<W>(b.y, v.y, m.dt, m.damping),
                   damped<W>(b.z, v.z, m.dt, m.damping)};
  };
  for (std::size_t at = 0; at < a.header->spheres; at += W) {
    Spheres<W> s;
    s.gather(a.spheres + at, [](int k) FEMXDEM_LAMBDA { return k; });
    const Vec<W> mass = load<Vec<W>>(a.mass + at), inertia = load<Vec<W>>(a.inertia + at);
    const Vec3<W> x = s.x(), v = s.v(), f = s.f(), t = s.t();
    const Vec3<W> fluctuation = v - times(m.previous_L, x);
    Vec3<W> acceleration = damp({f.x / mass, f.y / mass, f.z / mass}, fluctuation);
    acceleration = acceleration + times(m.previous_L, v);
    Vec3<W> velocity = v + scaled<W>(splat<W>(m.dt), acceleration);
    const Vec3<W> angular = damp({t.x / inertia, t.y / inertia, t.z / inertia}, s.w());
    Vec3<W> spin = s.w() + scaled<W>(splat<W>(m.dt), angular);
    velocity = velocity + times(m.change, x);
    const Vec3<W> place = x + scaled<W>(splat<W>(m.dt), velocity);
    spin = {spin.x + m.spin[0], spin.y + m.spin[1], spin.z + m.spin[2]};
    turn<W>(a.turned, at, spin, m.dt);
    const Vec3<W> d = place - times(m.since_list, load3<W>(a.list_x, at));
    const Vec<W> distance = dot(d, d);
    farthest = distance > farthest ? distance : farthest;
    s.set(0, place);
    s.set(3, velocity);
    s.set(6, spin);
    s.set(kForce, Vec3<W>{}), s.set(kForce + 3, Vec3<W>{});
    s.write(a.spheres + at);
  }
  double largest = 0;
  for (int k = 0; k < W; ++k) largest = std::max(largest, lane<W>(farthest, k));
  return largest;
}

/// W contacts between their spheres.
template <int W>
struct Pairs {
  Spheres<W> i, j;
  Vec3<W> shifted;  ///< place of the image of j [m]
  Vec3<W> normal;
  Vec<W> overlap;
  Vec<W> opening;  ///< rate at which the overlap becomes less [m/s]
  Vec3<W> shear;   ///< force turned with the contact, minus ks times the slip

  FEMXDEM_INLINE void measure(const CompactArrays& a, const CompactCellMotion& cell, std::size_t at) {
    i.gather(a.spheres, [&](int k) FEMXDEM_LAMBDA { return a.i[at + static_cast<std::size_t>(k)]; });
    j.gather(a.spheres, [&](int k) FEMXDEM_LAMBDA { return a.j[at + static_cast<std::size_t>(k)]; });
    const auto packed = load<typename Lanes<W>::I>(a.shift + at);
    const Vec3<W> periods = {to_double<W>((packed << 22) >> 22), to_double<W>((packed << 12) >> 22),
                             to_double<W>((packed << 2) >> 22)};
    shifted = j.x() + times(cell.H, periods);
    const Vec3<W> d = shifted - i.x();
    const Vec<W> length = square_root(dot(d, d));
    normal = {d.x / length, d.y / length, d.z / length};
    const Vec<W> ri = i.radius(), rj = j.radius();
    overlap = ri + rj - length;
    const Vec<W> alpha = (ri + rj) / (ri + rj - overlap);
    const Vec3<W> vi = i.v(), vj = j.v(), wi = i.w(), wj = j.w();
    Vec3<W> slip = scaled<W>(alpha, vj - vi);
    slip = slip + cross(wj, scaled<W>(-rj, normal));
    slip = slip - cross(wi, scaled<W>(ri, normal));
    slip = slip + scaled<W>(alpha, times(cell.G, periods));
    const Vec<W> along = dot(normal, slip);
    opening = along / alpha;
    slip = slip - scaled<W>(along, normal);
    const Vec3<W> before = load3<W>(a.normal, at);
    const Vec<W> twist = (cell.dt * 0.5) * dot(before, wi + wj);
    shear = load3<W>(a.shear, at);
    shear = shear - cross(shear, cross(before, normal));
    shear = shear - cross(shear, scaled<W>(twist, before));
    shear = shear - scaled<W>(load<Vec<W>>(a.ks + at), scaled<W>(splat<W>(cell.dt), slip));
  }
};

/// Forces and torques of W contacts on one of their spheres each.
template <int W>
struct Wrenches {
  Vec<W> numbers[8];

  /// -0 leaves the spin and the radius beside a force as they are, to the bit.
  FEMXDEM_INLINE Wrenches(const Vec3<W>& f, const Vec3<W>& t)
      : numbers{splat<W>(-0.0), splat<W>(-0.0), f.x, f.y, f.z, t.x, t.y, t.z} {
    repeat<8 / W>([&](auto part) FEMXDEM_LAMBDA { transpose<W>(numbers + W * part); });
  }
  FEMXDEM_INLINE void add(CompactSphere* to, int k) const {
    repeat<8 / W>([&](auto part) FEMXDEM_LAMBDA {
      double* place = reinterpret_cast<double*>(to) + 8 + W * part;
      store(place, load<Vec<W>>(place) + numbers[W * part + k]);
    });
  }
};

template <int W>
FEMXDEM_INLINE void push(const CompactArrays& a, std::size_t at, const Wrenches<W>& on_i, const Wrenches<W>& on_j) {
  const std::size_t count = a.header->contacts - at;
  repeat<W>([&](auto k) FEMXDEM_LAMBDA {
    if (k >= count) return;
    on_i.add(a.spheres + a.i[at + k], k);
    on_j.add(a.spheres + a.j[at + k], k);
  });
}

/// The classes of W contacts, number by number.
template <int W>
struct Classes {
  Vec<W> adhesion, shear_adhesion, unp_limit, tangent, fragile, breakable;

  FEMXDEM_INLINE Classes(const CompactArrays& a, std::size_t at) {
    const std::uint32_t* which = a.class_of + at;
    std::uint32_t differ = 0;
    repeat<W>([&](auto k) FEMXDEM_LAMBDA { differ |= which[k] ^ which[0]; });
    if (differ == 0) {
      const CompactClass& c = a.classes[which[0]];
      adhesion = splat<W>(c.normal_adhesion), shear_adhesion = splat<W>(c.shear_adhesion);
      unp_limit = splat<W>(c.unp_limit), tangent = splat<W>(c.tangent);
      fragile = splat<W>(c.fragile), breakable = splat<W>(c.breakable);
      return;
    }
    repeat<W>([&](auto k) FEMXDEM_LAMBDA {
      const CompactClass& c = a.classes[which[k]];
      lane<W>(adhesion, k) = c.normal_adhesion, lane<W>(shear_adhesion, k) = c.shear_adhesion;
      lane<W>(unp_limit, k) = c.unp_limit, lane<W>(tangent, k) = c.tangent;
      lane<W>(fragile, k) = c.fragile, lane<W>(breakable, k) = c.breakable;
    });
  }
};

/// Appends the contacts in whose lanes `ends` is true; how many.
template <int W>
FEMXDEM_INLINE std::size_t note(const CompactArrays& a, std::size_t at, Vec<W> ends, std::uint32_t* lost) {
  std::size_t count = 0;
  for (int k = 0; k < W; ++k)
    if (lane<W>(ends, k) != 0 && at + static_cast<std::size_t>(k) < a.header->contacts)
      lost[count++] = static_cast<std::uint32_t>(at + static_cast<std::size_t>(k));
  return count;
}

template <int W>
FEMXDEM_INLINE void break_bonds(const CompactArrays& a, std::size_t at, Vec<W> breaks) {
  for (int k = 0; k < W; ++k) {
    std::uint32_t& c = a.class_of[at + static_cast<std::size_t>(k)];
    if (lane<W>(breaks, k) != 0) c = static_cast<std::uint32_t>(a.classes[c].when_broken);
  }
}

template <int W>
FEMXDEM_INLINE std::size_t cohesive(const CompactArrays& a, const CompactCellMotion& cell, std::uint32_t* lost) {
  std::size_t lost_count = 0;
  const Vec<W> zero{};
  for (std::size_t at = 0; at < a.header->contacts; at += W) {
    Pairs<W> p;
    p.measure(a, cell, at);
    const Classes<W> c(a, at);
    const Vec<W> kn = load<Vec<W>>(a.kn + at);
    Vec<W> unp = load<Vec<W>>(a.unp + at);
    Vec<W> normal_force = kn * (p.overlap - unp);
    const Vec<W> torn = greater(-normal_force, c.adhesion), yields = torn * (1.0 - c.fragile);
    normal_force = either(yields, -c.adhesion, normal_force);
    unp = either(yields, p.overlap + c.adhesion / kn, unp);
    const Vec<W> ends = torn * (c.fragile + greater(-unp, c.unp_limit));
    const Vec<W> friction = normal_force * c.tangent;
    Vec<W> limit = c.shear_adhesion + friction;
    limit = limit > zero ? limit : zero;
    const Vec<W> size = square_root(dot(p.shear, p.shear)), slides = greater(size, limit);
    const Vec<W> breaks = slides * c.breakable;
    limit = either(breaks, friction > zero ? friction : zero, limit);
    const Vec3<W> shear = scaled<W>(either(slides, limit / size, splat<W>(1.0)), p.shear);
    normal_force = either(-(slides * normal_force), zero, normal_force);
    Vec3<W> f = -scaled<W>(normal_force, p.normal) - shear;
    f = {either(ends, zero, f.x), either(ends, zero, f.y), either(ends, zero, f.z)};
    const Vec3<W> xi = p.i.x(), point = xi + scaled<W>(p.i.radius() - 0.5 * p.overlap, p.normal);
    const Wrenches<W> on_i(f, cross(point - xi, f)), on_j(-f, -cross(point - p.shifted, f));
    push<W>(a, at, on_i, on_j);
    store(a.unp + at, unp);
    store(a.normal_force + at, normal_force);
    store3<W>(a.shear, at, shear);
    store3<W>(a.normal, at, p.normal);
    if (!any<W>(breaks + ends)) continue;
    break_bonds<W>(a, at, breaks);
    lost_count += note<W>(a, at, ends, lost + lost_count);
  }
  return lost_count;
}

/// What W contacts answer with: normal force, the same as a vector, shear force, and whether they end.
template <int W>
struct Answers {
  Vec<W> normal_force;
  Vec3<W> N, shear;
  Vec<W> ends;
};

/// Pushes the spheres at the middle of the overlap and keeps the forces; returns the number of contacts that end.
template <int W>
FEMXDEM_INLINE std::size_t act(const CompactArrays& a, std::size_t at, const Pairs<W>& p, const Answers<W>& r,
                               std::uint32_t* lost) {
  const Vec<W> zero{};
  Vec3<W> f = -r.N - r.shear;
  f = {either(r.ends, zero, f.x), either(r.ends, zero, f.y), either(r.ends, zero, f.z)};
  const Vec3<W> t = cross(p.normal, f);
  const Vec<W> half = 0.5 * p.overlap;
  const Wrenches<W> on_i(f, scaled<W>(p.i.radius() - half, t)), on_j(-f, scaled<W>(p.j.radius() - half, t));
  push<W>(a, at, on_i, on_j);
  store(a.normal_force + at, r.normal_force);
  store3<W>(a.shear, at, r.shear);
  store3<W>(a.normal, at, p.normal);
  return any<W>(r.ends) ? note<W>(a, at, r.ends, lost) : 0;
}

template <int W>
FEMXDEM_INLINE std::size_t friction(const CompactArrays& a, const CompactCellMotion& cell, std::uint32_t* lost) {
  std::size_t lost_count = 0;
  const Vec<W> zero{};
  for (std::size_t at = 0; at < a.header->contacts; at += W) {
    Pairs<W> p;
    p.measure(a, cell, at);
    const Classes<W> c(a, at);
    const Vec<W> ends = greater(zero, p.overlap);
    const Vec<W> normal_force = load<Vec<W>>(a.kn + at) * (p.overlap > zero ? p.overlap : zero);
    const Vec3<W> N = scaled<W>(normal_force, p.normal);
    const Vec<W> limit = dot(N, N) * (c.tangent * c.tangent), size = dot(p.shear, p.shear);
    const Vec<W> ratio = square_root(limit) / square_root(size);
    const Vec3<W> shear = scaled<W>(size > limit ? ratio : splat<W>(1.0), p.shear);
    lost_count += act<W>(a, at, p, {normal_force, N, shear, ends}, lost + lost_count);
  }
  return lost_count;
}

/// Constants of the dashpots of W contacts [N s/m].
template <int W>
FEMXDEM_INLINE Vec<W> dashpots(const CompactArrays& a, std::size_t at, Vec<W> kn) {
  Vec<W> mi{}, mj{};
  repeat<W>([&](auto k) FEMXDEM_LAMBDA {
    lane<W>(mi, k) = a.mass[a.i[at + k]];
    lane<W>(mj, k) = a.mass[a.j[at + k]];
  });
  return (2 * a.header->viscous_damping) * square_root(kn * (mi * mj / (mi + mj)));
}

template <int W>
FEMXDEM_INLINE std::size_t paper(const CompactArrays& a, const CompactCellMotion& cell, std::uint32_t* lost) {
  std::size_t lost_count = 0;
  const Vec<W> zero{};
  const bool viscous = a.header->viscous_damping > 0;
  for (std::size_t at = 0; at < a.header->contacts; at += W) {
    Pairs<W> p;
    p.measure(a, cell, at);
    const Classes<W> c(a, at);
    const Vec<W> ends = greater(zero, p.overlap), kn = load<Vec<W>>(a.kn + at);
    Vec<W> repulsion = kn * p.overlap;
    if (viscous) repulsion = repulsion - dashpots<W>(a, at, kn) * p.opening;
    repulsion = repulsion > zero ? repulsion : zero;
    const Vec<W> normal_force = repulsion - c.adhesion;
    const Vec<W> limit = repulsion * c.tangent, size = square_root(dot(p.shear, p.shear));
    const Vec3<W> shear = scaled<W>(size > limit ? limit / size : splat<W>(1.0), p.shear);
    lost_count += act<W>(a, at, p, {normal_force, scaled<W>(normal_force, p.normal), shear, ends}, lost + lost_count);
  }
  return lost_count;
}

#define FEMXDEM_LOOPS(NAME, LEVEL, W)                                                                          \
  LEVEL double NAME##_integrate(const CompactArrays& a, const CompactMotion& m) { return integrate<W>(a, m); } \
  LEVEL std::size_t NAME##_cohesive(const CompactArrays& a, const CompactCellMotion& c, unsigned* to) {        \
    return cohesive<W>(a, c, to);                                                                              \
  }                                                                                                            \
  LEVEL std::size_t NAME##_friction(const CompactArrays& a, const CompactCellMotion& c, unsigned* to) {        \
    return friction<W>(a, c, to);                                                                              \
  }                                                                                                            \
  LEVEL std::size_t NAME##_paper(const CompactArrays& a, const CompactCellMotion& c, unsigned* to) {           \
    return paper<W>(a, c, to);                                                                                 \
  }                                                                                                            \
  constexpr CompactLoops NAME##_loops = {NAME##_integrate, NAME##_cohesive, NAME##_friction, NAME##_paper};

FEMXDEM_LOOPS(baseline, , 2)
#ifdef __x86_64__
FEMXDEM_LOOPS(v3, [[gnu::target("arch=x86-64-v3")]], 4)
FEMXDEM_LOOPS(v4, [[gnu::target("arch=x86-64-v4")]], 8)
#endif

/// FEMXDEM_KERNEL's, or the fastest.
Kernel kernel_at_start() {
  const char* wish = std::getenv("FEMXDEM_KERNEL");
  const std::vector<Kernel> there = kernels();
  if (!wish || !*wish) return there.back();
  const std::array<std::string, 3> names = {"baseline", "x86-64-v3", "x86-64-v4"};
  const auto k = static_cast<std::size_t>(std::find(names.begin(), names.end(), wish) - names.begin());
  if (k < there.size()) return there[k];
  throw UserError(std::string("FEMXDEM_KERNEL = \"") + wish +
                  "\": this processor has no such kernel; use baseline, x86-64-v3 or x86-64-v4");
}

Kernel& current_kernel() {
  static Kernel kernel = kernel_at_start();
  return kernel;
}

}  // namespace

std::vector<Kernel> kernels() {
  std::vector<Kernel> there = {Kernel::baseline};
#ifdef __x86_64__
  if (__builtin_cpu_supports("x86-64-v3")) there.push_back(Kernel::x86_64_v3);
  if (__builtin_cpu_supports("x86-64-v4")) there.push_back(Kernel::x86_64_v4);
#endif
  return there;
}

void use_kernel(Kernel kernel) {
  const std::vector<Kernel> there = kernels();
  if (std::find(there.begin(), there.end(), kernel) == there.end())
    throw UserError("this processor does not have the kernel that is asked for; leave FEMXDEM_KERNEL empty");
  current_kernel() = kernel;
}

Kernel kernel_in_use() { return current_kernel(); }

const CompactLoops& compact_loops() {
#ifdef __x86_64__
  if (current_kernel() == Kernel::x86_64_v4) return v4_loops;
  if (current_kernel() == Kernel::x86_64_v3) return v3_loops;
#endif
  return baseline_loops;
}

}  // namespace femxdem
