#include "compact_scene.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <numeric>
#include <vector>

#include "compact_step.hpp"
#include "errors.hpp"
#include "packet.hpp"

namespace femxdem {
namespace {

constexpr std::string_view kMagic = "fxdscene";
constexpr std::int64_t kVersion = 2;
constexpr std::size_t kHeadWords = 53;  // before the spheres

/// A number that is T in the export and anything here; the same sequence of calls reads a scene and writes it.
template <class T, class Number>
void number(PacketReader& reader, Number& target) {
  target = static_cast<Number>(reader.get<T>());
}
template <class T, class Number>
void number(PacketWriter& writer, const Number& source) {
  writer.put(static_cast<T>(source));
}

/// A contact as the export has it.
struct SceneContact {
  std::array<std::int64_t, 2> ids{};
  std::array<std::int64_t, 3> shift{};
  std::int64_t waits = 0;
  double kn = 0, ks = 0;
  CompactClass kind;
  double unp = 0, normal_force = 0;
  std::array<double, 3> shear{}, normal{};
};

/// The numbers of the header that the export has, in its order.
template <class Stream, class Header>
void header_numbers(Stream& s, Header& h) {
  for (auto* scalar : {&h.time_step, &h.damping}) number<double>(s, *scalar);
  for (auto* tensor : {&h.H, &h.trsf, &h.L, &h.previous_L})
    for (auto& entry : *tensor) number<double>(s, entry);
  for (auto* scalar : {&h.new_adhesion, &h.new_friction, &h.constant_kn, &h.constant_ks, &h.safety, &h.density,
                       &h.mean_diameter, &h.solid_volume, &h.viscous_damping})
    number<double>(s, *scalar);
}

template <class Stream>
void sphere_numbers(Stream& s, const CompactArrays& a) {
  const std::size_t n = a.header->spheres;
  for (auto member : {&CompactSphere::x, &CompactSphere::v, &CompactSphere::w, &CompactSphere::f, &CompactSphere::t})
    for (std::size_t k = 0; k < n; ++k)
      for (double& entry : a.spheres[k].*member) number<double>(s, entry);
  for (std::size_t k = 0; k < n; ++k)
    for (double* part : a.turned) number<double>(s, part[k]);
  for (std::size_t k = 0; k < n; ++k) number<double>(s, a.spheres[k].radius);
  for (double* array : {a.mass, a.inertia, a.young, a.poisson, a.tangent})
    for (std::size_t k = 0; k < n; ++k) number<double>(s, array[k]);
}

template <class Stream>
void contact_numbers(Stream& s, std::vector<SceneContact>& contacts) {
  for (auto& c : contacts)
    for (auto& id : c.ids) number<std::int64_t>(s, id);
  for (auto& c : contacts)
    for (auto& entry : c.shift) number<std::int64_t>(s, entry);
  for (auto& c : contacts) number<std::int64_t>(s, c.waits);
  const auto each = [&](auto get) {
    for (auto& c : contacts) number<double>(s, get(c));
  };
  each([](SceneContact& c) -> double& { return c.kn; });
  each([](SceneContact& c) -> double& { return c.ks; });
  each([](SceneContact& c) -> double& { return c.kind.normal_adhesion; });
  each([](SceneContact& c) -> double& { return c.kind.shear_adhesion; });
  each([](SceneContact& c) -> double& { return c.unp; });
  each([](SceneContact& c) -> double& { return c.kind.unp_max; });
  each([](SceneContact& c) -> double& { return c.kind.tangent; });
  each([](SceneContact& c) -> double& { return c.kind.fragile; });
  each([](SceneContact& c) -> double& { return c.kind.broken; });
  each([](SceneContact& c) -> double& { return c.normal_force; });
  for (auto member : {&SceneContact::shear, &SceneContact::normal})
    for (auto& c : contacts)
      for (double& entry : c.*member) number<double>(s, entry);
}

/// The classes that the contacts and their future need, each once.
class ClassTable {
 public:
  explicit ClassTable(const CompactHeader& header)
      : cohesive_(header.law == CompactLaw::friction ? 0.0 : 1.0),
        at_once_(header.law == CompactLaw::paper && !std::isnan(header.new_adhesion)),
        adhesion_(header.new_adhesion),
        friction_(header.new_friction) {}

  std::uint32_t add(const CompactClass& c) {
    const Key key = {c.normal_adhesion, c.shear_adhesion, c.unp_max, c.tangent, c.fragile, c.broken, c.for_new};
    const auto [place, added] = places_.try_emplace(key, static_cast<std::uint32_t>(classes_.size()));
    const std::uint32_t at = place->second;
    if (!added) return at;
    classes_.push_back(c);
    const bool breakable = c.fragile != 0 && c.broken == 0;
    classes_[at].breakable = breakable;
    classes_[at].unp_limit = c.unp_max >= 0 ? c.unp_max : std::numeric_limits<double>::infinity();
    const std::uint32_t broken = breakable ? add({0, 0, c.unp_max, c.tangent, c.fragile, 1, 0, -1, 0, 0, 0}) : at;
    classes_[at].when_broken = broken;
    return at;
  }
  /// Contacts that have just formed; if they become adhesive, they wait for it, but not under the paper's law.
  std::uint32_t add_new(double tangent) {
    if (at_once_) return add({adhesion_, friction_ * adhesion_, 0, tangent, 0, 0, 0, -1, 1, 0, 0});
    const std::uint32_t at = add({0, 0, 0, tangent, cohesive_, cohesive_, 0, -1, 1, 0, 0});
    if (!std::isnan(adhesion_) && classes_[at].when_aged < 0) {
      const std::uint32_t aged = add({adhesion_, friction_ * adhesion_, 0, tangent, 0, 0, 0, -1, 0, 0, 0});
      classes_[at].when_aged = aged;
    }
    return at;
  }
  const std::vector<CompactClass>& classes() const { return classes_; }

 private:
  using Key = std::array<double, 7>;
  double cohesive_;
  bool at_once_;
  double adhesion_, friction_;
  std::map<Key, std::uint32_t> places_;
  std::vector<CompactClass> classes_;
};

void check_contacts(const std::vector<SceneContact>& contacts, std::int64_t spheres) {
  for (const SceneContact& c : contacts) {
    const bool shifts = std::all_of(c.shift.begin(), c.shift.end(), [](auto s) { return std::abs(s) <= kMaxShift; });
    if (!(0 <= c.ids[0] && c.ids[0] < c.ids[1] && c.ids[1] < spheres && shifts))
      throw UserError("export of a YADE scene: a contact of a sphere that is not there; export it again");
  }
}

void fill_contacts(const CompactArrays& a, const std::vector<SceneContact>& contacts,
                   const std::vector<std::uint32_t>& class_of) {
  a.header->contacts = static_cast<std::uint32_t>(contacts.size());
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    const SceneContact& from = contacts[c];
    a.i[c] = static_cast<std::uint32_t>(from.ids[0]), a.j[c] = static_cast<std::uint32_t>(from.ids[1]);
    a.shift[c] =
        pack_shift(static_cast<int>(from.shift[0]), static_cast<int>(from.shift[1]), static_cast<int>(from.shift[2]));
    a.class_of[c] = class_of[c];
    a.header->new_contacts += a.classes[class_of[c]].when_aged >= 0;
    a.kn[c] = from.kn, a.ks[c] = from.ks, a.unp[c] = from.unp, a.normal_force[c] = from.normal_force;
    const double adhesion = a.classes[class_of[c]].normal_adhesion;
    if (a.header->law == CompactLaw::paper) a.unp[c] = adhesion > 0 ? adhesion / a.kn[c] : 0;
    for (std::size_t k = 0; k < 3; ++k) a.shear[k][c] = from.shear[k], a.normal[k][c] = from.normal[k];
  }
}

/// A block without contacts from the head of an export; the reader then stands before the contacts.
struct Head {
  CompactHeader header;
  std::int64_t spheres = 0, contacts = 0;
};

Head read_head(PacketReader& reader) {
  Head head;
  std::int64_t version = 0, law = 0;
  if (reader.left() < kHeadWords * 8) throw UserError("export of a YADE scene: it is truncated; export it again");
  number<std::int64_t>(reader, version);
  if (version != kVersion) throw UserError("export of a YADE scene: it is of another version; export it again");
  number<std::int64_t>(reader, law);
  number<std::int64_t>(reader, head.spheres), number<std::int64_t>(reader, head.contacts);
  number<std::int64_t>(reader, head.header.iteration), number<std::int64_t>(reader, head.header.start_vectors);
  header_numbers(reader, head.header);
  const auto n = static_cast<std::size_t>(head.spheres), m = static_cast<std::size_t>(head.contacts);
  const bool sizes = head.spheres >= 2 && head.contacts >= 0 && n < 1U << 28 && m < 1U << 28;
  if (!sizes || law < 0 || law > 2 || head.header.start_vectors > 1 ||
      reader.left() != 8 * (n * (25 + 6 * head.header.start_vectors) + m * 22))
    throw UserError("export of a YADE scene: its size is wrong; export it again");
  head.header.law = static_cast<CompactLaw>(law);
  head.header.spheres = static_cast<std::uint32_t>(n);
  return head;
}

}  // namespace

CompactBlock block_of_scene(std::string_view exported) {
  if (exported.substr(0, kMagic.size()) != kMagic) throw UserError("this is not the export of a YADE scene");
  PacketReader reader(exported.substr(kMagic.size()));
  Head head = read_head(reader);
  CompactBlock spheres(head.header);  // until the classes are known
  sphere_numbers(reader, spheres.arrays());
  std::vector<SceneContact> contacts(static_cast<std::size_t>(head.contacts));
  contact_numbers(reader, contacts);
  check_contacts(contacts, head.spheres);
  std::sort(contacts.begin(), contacts.end(), [](const auto& p, const auto& q) { return p.ids < q.ids; });
  ClassTable table(head.header);
  const CompactArrays& s = spheres.arrays();
  for (std::size_t k = 0; k < head.header.spheres; ++k) table.add_new(s.tangent[k]);
  std::vector<std::uint32_t> class_of;
  for (const SceneContact& c : contacts)
    class_of.push_back(c.waits ? table.add_new(c.kind.tangent) : table.add(c.kind));
  CompactHeader& h = head.header;
  h.classes = static_cast<std::uint32_t>(table.classes().size());
  h.contact_capacity = static_cast<std::uint32_t>(contacts.size() + contacts.size() / 10 + 64);
  const auto by_radius = std::minmax_element(s.spheres, s.spheres + h.spheres,
                                             [](const auto& p, const auto& q) { return p.radius < q.radius; });
  h.min_radius = by_radius.first->radius, h.max_radius = by_radius.second->radius;
  CompactBlock block(h);
  const CompactArrays& a = block.arrays();
  std::copy(table.classes().begin(), table.classes().end(), a.classes);
  std::copy_n(s.spheres, h.spheres, a.spheres);
  for (const auto& [from, to] : {std::pair{s.mass, a.mass},
                                 {s.inertia, a.inertia},
                                 {s.young, a.young},
                                 {s.poisson, a.poisson},
                                 {s.tangent, a.tangent},
                                 {s.turned[0], a.turned[0]},
                                 {s.turned[1], a.turned[1]},
                                 {s.turned[2], a.turned[2]},
                                 {s.turned[3], a.turned[3]}})
    std::copy_n(from, h.spheres, to);
  if (h.start_vectors)
    for (std::size_t k = 0; k < std::size_t{6} * h.spheres; ++k) number<double>(reader, a.start[k]);
  fill_contacts(a, contacts, class_of);
  make_list(block);
  if (h.law == CompactLaw::paper) find_forces(block);
  return block;
}

bool same_state(std::string_view one, std::string_view other) {
  if (one.substr(0, kMagic.size()) != kMagic) throw UserError("this is not the export of a YADE scene");
  PacketReader reader(one.substr(kMagic.size()));
  const Head head = read_head(reader);
  const auto n = static_cast<std::size_t>(head.spheres);
  const std::size_t turned = one.size() - reader.left() + 8 * 15 * n, end = turned + 8 * 4 * n;
  if (one.size() != other.size() || one.substr(0, turned) != other.substr(0, turned) ||
      one.substr(end) != other.substr(end))
    return false;
  for (std::size_t at = turned; at < end; at += 8) {
    double a = 0, b = 0;
    std::memcpy(&a, one.data() + at, 8);
    std::memcpy(&b, other.data() + at, 8);
    if (!(std::abs(a - b) <= 1e-12)) return false;
  }
  return true;
}

std::string scene_of_block(const CompactBlock& block) {
  const CompactArrays& a = block.arrays();
  const CompactHeader& h = *a.header;
  PacketWriter writer;
  for (const std::int64_t count :
       {kVersion, static_cast<std::int64_t>(h.law), static_cast<std::int64_t>(h.spheres),
        static_cast<std::int64_t>(h.contacts), h.iteration, static_cast<std::int64_t>(h.start_vectors)})
    number<std::int64_t>(writer, count);
  header_numbers(writer, h);
  sphere_numbers(writer, a);
  std::vector<SceneContact> contacts(h.contacts);
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    SceneContact& to = contacts[c];
    to.ids = {a.i[c], a.j[c]};
    for (int k = 0; k < 3; ++k) to.shift[static_cast<std::size_t>(k)] = unpack_shift(a.shift[c], k);
    to.kind = a.classes[a.class_of[c]];
    to.waits = to.kind.when_aged >= 0;
    to.kn = a.kn[c], to.ks = a.ks[c], to.unp = a.unp[c], to.normal_force = a.normal_force[c];
    for (std::size_t k = 0; k < 3; ++k) to.shear[k] = a.shear[k][c], to.normal[k] = a.normal[k][c];
  }
  contact_numbers(writer, contacts);
  if (h.start_vectors)
    for (std::size_t k = 0; k < std::size_t{6} * h.spheres; ++k) number<double>(writer, a.start[k]);
  return std::string(kMagic) + writer.take();
}

}  // namespace femxdem
