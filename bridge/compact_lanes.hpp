#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>

#include "compact_block.hpp"

/// W numbers at once, in the compiler's vectors, for compact_kernel.cpp alone: internal to it, because every function
/// must be inlined into the loop of one processor level.
namespace femxdem {
namespace {

// Vectors are only fast where every function that holds them is inlined into the one that has the processor's level.
#define FEMXDEM_INLINE [[gnu::always_inline]] inline

#define FEMXDEM_LAMBDA __attribute__((always_inline))

/// f(0), f(1), ..., f(N - 1) with constants: arrays of vectors then live in registers.
template <int N, class F>
FEMXDEM_INLINE void repeat(F f) {
  [&]<int... K>(std::integer_sequence<int, K...>) FEMXDEM_LAMBDA { (f(std::integral_constant<int, K>{}), ...); }
  (std::make_integer_sequence<int, N>{});
}

template <int W>
struct Lanes {
  using V [[gnu::vector_size(8 * W)]] = double;
  using I [[gnu::vector_size(4 * W)]] = std::int32_t;
};
template <int W>
using Vec = typename Lanes<W>::V;

template <class T>
FEMXDEM_INLINE T load(const void* from) {
  T v;
  std::memcpy(&v, from, sizeof v);
  return v;
}

template <class T>
FEMXDEM_INLINE void store(void* to, const T& v) {
  std::memcpy(to, &v, sizeof v);
}

template <int W>
FEMXDEM_INLINE Vec<W> splat(double a) {
  return Vec<W>{} + a;
}

template <int W>
FEMXDEM_INLINE double& lane(Vec<W>& v, int k) {
  return reinterpret_cast<double*>(&v)[k];
}

template <class V>
FEMXDEM_INLINE V square_root(V a) {
  V r = a;
  repeat<sizeof(V) / sizeof(double)>([&](auto k) FEMXDEM_LAMBDA { r[int{k}] = __builtin_sqrt(a[int{k}]); });
  return r;
}

// What is true is 1, what is not is 0, and "and" is a product: GCC 12 takes masks of 512 bits apart that are combined.
template <class V>
FEMXDEM_INLINE V greater(V a, V b) {
  return a > b ? V{} + 1.0 : V{};
}
template <class V>
FEMXDEM_INLINE V either(V which, V a, V b) {
  return which > V{} ? a : b;
}

/// Whether something is true in some lane.
template <int W>
FEMXDEM_INLINE bool any(Vec<W> a) {
  if constexpr (W == 8) a += __builtin_shufflevector(a, a, 4, 5, 6, 7, 0, 1, 2, 3);
  if constexpr (W == 8) a += __builtin_shufflevector(a, a, 2, 3, 0, 1, 6, 7, 4, 5);
  if constexpr (W == 4) a += __builtin_shufflevector(a, a, 2, 3, 0, 1);
  return a[0] + a[1] > 0;
}

template <int W>
FEMXDEM_INLINE Vec<W> to_double(typename Lanes<W>::I a) {
  return __builtin_convertvector(a, Vec<W>);
}

/// rows[r][c] -> rows[c][r].
template <int W>
FEMXDEM_INLINE void transpose(Vec<W>* rows) {
  if constexpr (W == 2) {
    const Vec<2> a = rows[0], b = rows[1];
    rows[0] = __builtin_shufflevector(a, b, 0, 2);
    rows[1] = __builtin_shufflevector(a, b, 1, 3);
  } else if constexpr (W == 4) {
    const Vec<4> a = __builtin_shufflevector(rows[0], rows[1], 0, 4, 2, 6);
    const Vec<4> b = __builtin_shufflevector(rows[0], rows[1], 1, 5, 3, 7);
    const Vec<4> c = __builtin_shufflevector(rows[2], rows[3], 0, 4, 2, 6);
    const Vec<4> d = __builtin_shufflevector(rows[2], rows[3], 1, 5, 3, 7);
    rows[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5);
    rows[1] = __builtin_shufflevector(b, d, 0, 1, 4, 5);
    rows[2] = __builtin_shufflevector(a, c, 2, 3, 6, 7);
    rows[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
  } else if constexpr (W == 8) {
    Vec<8> a[8], b[8];
    repeat<4>([&](auto pair) FEMXDEM_LAMBDA {
      constexpr int k = 2 * pair;
      a[k] = __builtin_shufflevector(rows[k], rows[k + 1], 0, 8, 2, 10, 4, 12, 6, 14);
      a[k + 1] = __builtin_shufflevector(rows[k], rows[k + 1], 1, 9, 3, 11, 5, 13, 7, 15);
    });
    repeat<4>([&](auto quarter) FEMXDEM_LAMBDA {
      constexpr int k = quarter + (quarter > 1 ? 2 : 0);
      b[k] = __builtin_shufflevector(a[k], a[k + 2], 0, 1, 8, 9, 4, 5, 12, 13);
      b[k + 2] = __builtin_shufflevector(a[k], a[k + 2], 2, 3, 10, 11, 6, 7, 14, 15);
    });
    repeat<4>([&](auto k) FEMXDEM_LAMBDA {
      rows[k] = __builtin_shufflevector(b[k], b[k + 4], 0, 1, 2, 3, 8, 9, 10, 11);
      rows[k + 4] = __builtin_shufflevector(b[k], b[k + 4], 4, 5, 6, 7, 12, 13, 14, 15);
    });
  }
}

template <int W>
struct Vec3 {
  Vec<W> x, y, z;
};
template <int W>
FEMXDEM_INLINE Vec3<W> operator+(const Vec3<W>& a, const Vec3<W>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <int W>
FEMXDEM_INLINE Vec3<W> operator-(const Vec3<W>& a, const Vec3<W>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <int W>
FEMXDEM_INLINE Vec3<W> operator-(const Vec3<W>& a) {
  return {-a.x, -a.y, -a.z};
}
template <int W>
FEMXDEM_INLINE Vec3<W> scaled(Vec<W> s, const Vec3<W>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <int W>
FEMXDEM_INLINE Vec<W> dot(const Vec3<W>& a, const Vec3<W>& b) {
  return a.x * b.x + (a.y * b.y + a.z * b.z);
}
template <int W>
FEMXDEM_INLINE Vec3<W> cross(const Vec3<W>& a, const Vec3<W>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <int W>
FEMXDEM_INLINE Vec3<W> times(const Row3& A, const Vec3<W>& b) {
  return {A[0] * b.x + (A[1] * b.y + A[2] * b.z), A[3] * b.x + (A[4] * b.y + A[5] * b.z),
          A[6] * b.x + (A[7] * b.y + A[8] * b.z)};
}
template <int W>
FEMXDEM_INLINE Vec3<W> load3(const std::array<double*, 3>& arrays, std::size_t at) {
  return {load<Vec<W>>(arrays[0] + at), load<Vec<W>>(arrays[1] + at), load<Vec<W>>(arrays[2] + at)};
}
template <int W>
FEMXDEM_INLINE void store3(const std::array<double*, 3>& arrays, std::size_t at, const Vec3<W>& a) {
  store(arrays[0] + at, a.x);
  store(arrays[1] + at, a.y);
  store(arrays[2] + at, a.z);
}

}  // namespace
}  // namespace femxdem
