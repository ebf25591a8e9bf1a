#include "compact_block.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "errors.hpp"
#include "hash.hpp"

namespace femxdem {
namespace {

constexpr std::size_t kLine = 64;

std::size_t padded(std::size_t count) {
  return (count + CompactArrays::kLanes - 1) / CompactArrays::kLanes * CompactArrays::kLanes;
}

/// Hands out consecutive arrays of a block; from nothing it finds how large the block is.
class Layout {
 public:
  explicit Layout(std::byte* base) : base_(base) {}
  template <class T>
  void operator()(T*& array, std::size_t count) {
    array = base_ ? reinterpret_cast<T*>(base_ + offset_) : nullptr;
    offset_ += (count * sizeof(T) + kLine - 1) / kLine * kLine;
  }
  template <class T, std::size_t N>
  void operator()(std::array<T*, N>& arrays, std::size_t count) {
    for (T*& array : arrays) (*this)(array, count);
  }
  std::size_t bytes() const { return offset_; }

 private:
  std::byte* base_;
  std::size_t offset_ = 0;
};

/// The arrays of a block at `base` with the capacities of `header`; returns the bytes that they take.
std::size_t lay_out(std::byte* base, const CompactHeader& header, CompactArrays& a) {
  Layout place(base);
  const std::size_t n = padded(header.spheres), m = padded(header.contact_capacity);
  place(a.header, 1);
  place(a.spheres, n);
  for (double** array : {&a.mass, &a.inertia, &a.young, &a.poisson, &a.tangent}) place(*array, n);
  place(a.turned, n);
  place(a.list_x, n);
  place(a.classes, header.classes);
  place(a.i, m);
  place(a.j, m);
  place(a.shift, m);
  place(a.class_of, m);
  for (double** array : {&a.kn, &a.ks, &a.unp, &a.normal_force}) place(*array, m);
  place(a.shear, m);
  place(a.normal, m);
  place(a.pairs, header.pair_capacity);
  place(a.start, header.start_vectors ? std::size_t{6} * header.spheres : 0);
  return place.bytes();
}

std::size_t size_of(const CompactHeader& header) {
  CompactArrays nowhere;
  return lay_out(nullptr, header, nowhere);
}

/// What lies behind the spheres, contacts and pairs depends on how many the kernel takes at a time.
void clear_padding(const CompactArrays& a) {
  const CompactHeader& h = *a.header;
  for (std::size_t s = h.spheres; s < padded(h.spheres); ++s) {
    a.spheres[s] = {};
    a.mass[s] = a.inertia[s] = a.turned[0][s] = 1;  // the integrator divides by them
    a.turned[1][s] = a.turned[2][s] = a.turned[3][s] = 0;
  }
  for_each_contact_array(a, [&](auto* array) { std::fill(array + h.contacts, array + padded(h.contact_capacity), 0); });
  std::fill(a.pairs + h.pairs, a.pairs + h.pair_capacity, CompactPair{});
}

/// Of a saved block; the checksum's own place counts as zero.
std::uint64_t checksum(std::string_view bytes) {
  constexpr std::size_t kPlace = offsetof(CompactHeader, checksum);
  static_assert(kPlace % 8 == 0);
  constexpr std::array<char, 8> kZero{};
  Checksum sum;
  sum.add(bytes.substr(0, kPlace));
  sum.add({kZero.data(), kZero.size()});
  sum.add(bytes.substr(kPlace + kZero.size()));
  return sum.value();
}

/// Indices that point outside of their arrays would be read in every step.
bool consistent(const CompactArrays& a) {
  const CompactHeader& h = *a.header;
  if (h.spheres < 2 || h.contacts > h.contact_capacity || h.pairs > h.pair_capacity || h.classes == 0) return false;
  const auto pair = [&](std::uint32_t i, std::uint32_t j) { return i < j && j < h.spheres; };
  for (std::uint32_t c = 0; c < h.contacts; ++c)
    if (!pair(a.i[c], a.j[c]) || a.class_of[c] >= h.classes) return false;
  for (std::uint32_t c = 0; c < h.pairs; ++c)
    if (!pair(a.pairs[c].i, a.pairs[c].j)) return false;
  for (std::uint32_t k = 0; k < h.classes; ++k)
    if (!(a.classes[k].when_broken >= 0 && a.classes[k].when_broken < h.classes && a.classes[k].when_aged < h.classes))
      return false;
  return h.time_step >= 0 && std::isfinite(h.H[0]) && h.law <= CompactLaw::paper;
}

}  // namespace

CompactBlock::CompactBlock(const CompactHeader& header) {
  const std::size_t bytes = size_of(header);
  lines_.assign(bytes / kLine, Line{});
  CompactHeader first = header;
  first.bytes = bytes;
  std::memcpy(lines_.data(), &first, sizeof first);
  bind();
  clear_padding(arrays_);
}

CompactBlock::CompactBlock(std::string_view saved) {
  const auto refuse = [](const std::string& why) { throw UserError("state of a volume element: " + why); };
  CompactHeader header;
  if (saved.size() < sizeof header || saved.size() % kLine != 0) refuse("it is truncated; save it again");
  std::memcpy(&header, saved.data(), sizeof header);
  if (header.magic != CompactHeader::kMagic) refuse("it is not one of the compact engine's");
  if (header.version != CompactHeader::kVersion)
    refuse(fmt::format("its version is {}, this program reads version {}; go on with the program that wrote it",
                       header.version, CompactHeader::kVersion));
  if (header.bytes != saved.size() || size_of(header) != saved.size())
    refuse(fmt::format("it has {} bytes instead of {}; it is truncated or changed, save it again", saved.size(),
                       header.bytes));
  if (checksum(saved) != header.checksum) refuse("its checksum is wrong; it has been changed, save it again");
  lines_.resize(saved.size() / kLine);
  std::memcpy(static_cast<void*>(lines_.data()), saved.data(), saved.size());
  bind();
  if (!consistent(arrays_)) refuse("it contradicts itself; save it again");
}

void CompactBlock::bind() {
  auto* base = reinterpret_cast<std::byte*>(lines_.data());
  lay_out(base, *reinterpret_cast<CompactHeader*>(base), arrays_);
}

void CompactBlock::assign(const CompactBlock& other) {
  if (lines_.capacity() < other.lines_.size()) std::vector<Line>(other.lines_.size()).swap(lines_);
  lines_.resize(other.lines_.size());  // which would take twice the room, had it to grow
  std::memcpy(static_cast<void*>(lines_.data()), other.lines_.data(), other.lines_.size() * kLine);
  bind();
}

void CompactBlock::grow(std::size_t contacts, std::size_t pairs) {
  CompactHeader larger = header();
  larger.contact_capacity = static_cast<std::uint32_t>(std::max<std::size_t>(contacts, larger.contact_capacity));
  larger.pair_capacity = static_cast<std::uint32_t>(std::max<std::size_t>(pairs, larger.pair_capacity));
  CompactBlock grown(larger);
  const CompactArrays &a = arrays_, &b = grown.arrays_;
  const auto copy = [](const auto* from, std::size_t count, auto* to) { std::copy_n(from, count, to); };
  const auto copies = [&](const auto& from, std::size_t count, const auto& to) {
    for (std::size_t k = 0; k < from.size(); ++k) copy(from[k], count, to[k]);
  };
  const std::size_t n = padded(larger.spheres), m = larger.contacts;
  copy(a.spheres, n, b.spheres);
  copies(std::array{a.mass, a.inertia, a.young, a.poisson, a.tangent}, n,
         std::array{b.mass, b.inertia, b.young, b.poisson, b.tangent});
  copies(a.turned, n, b.turned);
  copies(a.list_x, n, b.list_x);
  copy(a.classes, larger.classes, b.classes);
  copies(std::array{a.i, a.j, a.class_of}, m, std::array{b.i, b.j, b.class_of});
  copy(a.shift, m, b.shift);
  copies(std::array{a.kn, a.ks, a.unp, a.normal_force}, m, std::array{b.kn, b.ks, b.unp, b.normal_force});
  copies(a.shear, m, b.shear);
  copies(a.normal, m, b.normal);
  copy(a.pairs, larger.pairs, b.pairs);
  if (larger.start_vectors) copy(a.start, std::size_t{6} * larger.spheres, b.start);
  lines_.swap(grown.lines_);
  bind();
}

std::string CompactBlock::save() const {
  clear_padding(arrays_);
  std::string bytes(reinterpret_cast<const char*>(lines_.data()), lines_.size() * kLine);
  const std::uint64_t sum = checksum(bytes);
  std::memcpy(bytes.data() + offsetof(CompactHeader, checksum), &sum, sizeof sum);
  return bytes;
}

}  // namespace femxdem
