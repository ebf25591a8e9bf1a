#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace femxdem {

/// What a contact between two spheres does.
enum class CompactLaw : std::uint32_t {
  cohesive,  ///< YADE's Law2_ScGeom6D_CohFrictPhys_CohesionMoment, momentRotationLaw off
  friction,  ///< YADE's Law2_ScGeom_FrictPhys_CundallStrack
  paper,     ///< that of Nguyen et al. (2017), which YADE has not: see compact_kernel.hpp
};

using Row3 = std::array<double, 9>;  ///< 3 x 3, row-major

/// What moves of a sphere: two cache lines.
struct alignas(64) CompactSphere {
  std::array<double, 3> x{};  ///< [m], never wrapped into the cell
  std::array<double, 3> v{};  ///< [m/s]
  std::array<double, 3> w{};  ///< spin [rad/s]
  double radius = 0;          ///< [m]
  std::array<double, 3> f{};  ///< [N]
  std::array<double, 3> t{};  ///< [N m]
};
static_assert(sizeof(CompactSphere) == 128);

/// What many contacts have in common. CohFrictPhys: normalAdhesion, shearAdhesion, unpMax, tangensOfFrictionAngle.
struct CompactClass {
  double normal_adhesion = 0;  ///< [N]
  double shear_adhesion = 0;   ///< [N]
  double unp_max = 0;          ///< [m], < 0: no limit
  double tangent = 0;          ///< of the friction angle
  double fragile = 0;          ///< 1: tension beyond the adhesion ends it, sliding breaks it
  double broken = 1;           ///< 1: cohesionBroken
  double when_broken = 0;      ///< class of a contact that has slid, as a number
  double when_aged = -1;       ///< class of a new contact that becomes adhesive, -1: it does not
  double for_new = 0;          ///< 1: of contacts that form later
  double unp_limit = 0;        ///< unp_max, or infinity [m]
  double breakable = 0;        ///< 1: fragile and not broken
};

/// A pair that may touch: image j + shift of sphere j near sphere i.
struct CompactPair {
  std::uint32_t i = 0, j = 0;
  std::int32_t shift = 0;  ///< see pack_shift
  float gap = 0;           ///< when the list was made, rounded down [m]; lowest() for a contact that was lost since
};

/// A cell shift, three whole numbers of at most +-kMaxShift, in one.
inline constexpr int kMaxShift = 511;
constexpr std::int32_t pack_shift(int a, int b, int c) {
  return static_cast<std::int32_t>((a & 1023) | (b & 1023) << 10 | (c & 1023) << 20);
}
constexpr int unpack_shift(std::int32_t packed, int axis) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(packed) << (22 - 10 * axis)) >> 22;
}

struct CompactHeader {
  static constexpr std::array<char, 8> kMagic = {'f', 'x', 'd', 'c', 'e', 'l', 'l', '\n'};
  static constexpr std::uint32_t kVersion = 2;

  std::array<char, 8> magic = kMagic;
  std::uint32_t version = kVersion;
  CompactLaw law = CompactLaw::cohesive;
  std::uint64_t checksum = 0;  ///< of a saved block
  std::uint64_t bytes = 0;
  std::uint32_t spheres = 0, contacts = 0, pairs = 0, classes = 0;
  std::uint32_t contact_capacity = 0, pair_capacity = 0;
  std::uint32_t start_vectors = 0;  ///< 1: the power iteration's start, 6 numbers a sphere, is there
  std::uint32_t new_contacts = 0;   ///< contacts that wait for their adhesion
  std::int64_t iteration = 0;       ///< of YADE's scene when it was exported, and every step since
  double time_step = 0, damping = 0;
  Row3 H{}, trsf{};        ///< cell vectors as columns [m]; deformation gradient from the reference
  Row3 L{}, previous_L{};  ///< velocity gradient; what the integrator used last [1/s]
  Row3 list_H{};           ///< H when the list of pairs was made
  double skin = 0;         ///< of that list [m]
  double max_radius = 0, min_radius = 0;
  double new_adhesion = 0, new_friction = 0;  ///< that later contacts get: [N], NaN: none; shear over normal adhesion
  double constant_kn = 0, constant_ks = 0;    ///< of later contacts [N/m]; NaN: from the materials
  double safety = std::numeric_limits<double>::quiet_NaN();  ///< of the time step; NaN: it follows nothing
  double density = 0, mean_diameter = 0, solid_volume = 0;   ///< [kg/m^3], [m], [m^3]
  double viscous_damping = 0;                                ///< of the paper's law: ratio of the critical [-]
};

/// Where everything of a block is. All arrays are as long as their capacity, rounded up to kLanes, and start at a cache
/// line.
struct CompactArrays {
  static constexpr std::size_t kLanes = 8;

  CompactHeader* header = nullptr;
  CompactSphere* spheres = nullptr;
  double *mass = nullptr, *inertia = nullptr, *young = nullptr, *poisson = nullptr, *tangent = nullptr;
  std::array<double*, 4> turned{};  ///< rotation since the reference, quaternion w, x, y, z
  std::array<double*, 3> list_x{};  ///< positions when the list of pairs was made
  CompactClass* classes = nullptr;
  // contacts in the order of (i, j), i < j
  std::uint32_t *i = nullptr, *j = nullptr;
  std::int32_t* shift = nullptr;
  std::uint32_t* class_of = nullptr;
  double *kn = nullptr, *ks = nullptr, *unp = nullptr;  ///< [N/m], [N/m], [m]
  double* normal_force = nullptr;                       ///< along the normal, compression positive [N]
  std::array<double*, 3> shear{}, normal{};             ///< [N], unit vector from i to j
  CompactPair* pairs = nullptr;                         ///< by gap, the largest first
  double* start = nullptr;                              ///< (2, spheres, 3) of the power iteration
};

template <class F>
void for_each_contact_array(const CompactArrays& a, F f) {
  f(a.i), f(a.j), f(a.shift), f(a.class_of);
  for (double* array : {a.kn, a.ks, a.unp, a.normal_force}) f(array);
  for (double* array : a.shear) f(array);
  for (double* array : a.normal) f(array);
}

/// One block of memory with a header and the arrays of CompactArrays.
class CompactBlock {
 public:
  /// Room for header.spheres, contact_capacity, pair_capacity, classes, start_vectors; zeros but for the header.
  explicit CompactBlock(const CompactHeader& header);
  /// From saved bytes. Throws UserError where they are truncated, changed or of another version.
  explicit CompactBlock(std::string_view saved);
  CompactBlock(const CompactBlock& other) : CompactBlock() { assign(other); }
  CompactBlock& operator=(const CompactBlock&) = delete;
  /// Becomes a copy; allocates only where it has never been as large.
  void assign(const CompactBlock& other);
  /// More room for contacts and pairs.
  void grow(std::size_t contacts, std::size_t pairs);
  std::string save() const;

  CompactHeader& header() const { return *arrays_.header; }
  const CompactArrays& arrays() const { return arrays_; }
  std::size_t memory() const { return lines_.capacity() * sizeof(Line); }

 private:
  struct alignas(64) Line {
    std::array<std::byte, 64> bytes;
  };
  CompactBlock() = default;
  void bind();

  std::vector<Line> lines_;
  CompactArrays arrays_;
};

}  // namespace femxdem
