#include "hash.hpp"

#include <fmt/format.h>

#include <cstring>

namespace femxdem {
namespace {

constexpr std::uint64_t kPrime = 1099511628211ull;

}  // namespace

std::uint64_t hash(std::string_view bytes) {
  std::uint64_t h = 14695981039346656037ull;
  for (const unsigned char c : bytes) h = (h ^ c) * kPrime;
  return h;
}

std::string hash_text(std::string_view bytes) { return fmt::format("{:016x}", hash(bytes)); }

void Checksum::add(std::string_view bytes) {
  const std::size_t first = size_ / 8, whole = bytes.size() / 8, rest = bytes.size() % 8;
  const auto mix = [&](std::size_t k, std::size_t length) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + 8 * k, length);
    std::uint64_t& lane = lanes_[(first + k) % lanes_.size()];
    lane = (lane ^ word) * kPrime;
    lane ^= lane >> 29;
  };
  for (std::size_t k = 0; k < whole; ++k) mix(k, 8);
  if (rest > 0) mix(whole, rest);
  size_ += bytes.size();
}

std::uint64_t Checksum::value() const {
  std::uint64_t sum = size_;
  for (const std::uint64_t lane : lanes_) sum = (sum ^ lane) * kPrime;
  return sum ^ sum >> 32;
}

}  // namespace femxdem
