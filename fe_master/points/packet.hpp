#pragma once

#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>

namespace femxdem {

/// Bytes of a message between ranks of one machine type, in the order in which they were put.
class PacketWriter {
 public:
  template <class T>
  requires std::is_arithmetic_v<T>
  void put(T number) { bytes_.append(reinterpret_cast<const char*>(&number), sizeof number); }
  void put_doubles(const double* numbers, std::size_t count) {
    bytes_.append(reinterpret_cast<const char*>(numbers), count * sizeof(double));
  }
  void put(std::string_view text) {
    put(text.size());
    bytes_.append(text);
  }
  std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

/// Reads them back; throws std::out_of_range past the end.
class PacketReader {
 public:
  explicit PacketReader(std::string_view bytes) : rest_(bytes) {}

  template <class T>
  requires std::is_arithmetic_v<T> T get() {
    T number;
    std::memcpy(&number, cut(sizeof number).data(), sizeof number);
    return number;
  }
  void get_doubles(double* numbers, std::size_t count) {
    std::memcpy(numbers, cut(count * sizeof(double)).data(), count * sizeof(double));
  }
  std::size_t left() const { return rest_.size(); }
  std::string get_text() {
    const auto size = get<std::size_t>();
    return std::string(cut(size));
  }

 private:
  std::string_view cut(std::size_t size) {
    if (size > rest_.size()) throw std::out_of_range("message between ranks: shorter than announced");
    const std::string_view front = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return front;
  }

  std::string_view rest_;
};

}  // namespace femxdem
