#include "manifest.hpp"

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <filesystem>

#include "output_folder.hpp"

namespace femxdem {
namespace {

/// Appends a code point as UTF-8; Python's lone surrogates U+DC80 to U+DCFF stand for the bytes of a file's name.
void append_code_point(std::string& text, std::uint32_t c) {
  if (c >= 0xDC80 && c <= 0xDCFF) {
    text += static_cast<char>(c - 0xDC00);
  } else if (c < 0x80) {
    text += static_cast<char>(c);
  } else if (c < 0x800) {
    text += {static_cast<char>(0xC0 | c >> 6), static_cast<char>(0x80 | (c & 0x3F))};
  } else if (c < 0x10000) {
    text += {static_cast<char>(0xE0 | c >> 12), static_cast<char>(0x80 | (c >> 6 & 0x3F)),
             static_cast<char>(0x80 | (c & 0x3F))};
  } else {
    text += {static_cast<char>(0xF0 | c >> 18), static_cast<char>(0x80 | (c >> 12 & 0x3F)),
             static_cast<char>(0x80 | (c >> 6 & 0x3F)), static_cast<char>(0x80 | (c & 0x3F))};
  }
}

std::uint32_t hexadecimal(std::string_view digits) {
  return static_cast<std::uint32_t>(std::strtoul(std::string(digits).c_str(), nullptr, 16));
}

/// A JSON text from its first quote at `at`, which is moved past its last one.
std::string read_text(std::string_view json, std::size_t& at) {
  std::string text;
  for (++at; at < json.size() && json[at] != '"'; ++at) {
    if (json[at] != '\\') {
      text += json[at];
      continue;
    }
    if (++at >= json.size()) break;
    constexpr std::string_view kShort = "\"\\/bfnrt", kMeaning = "\"\\/\b\f\n\r\t";
    if (const auto k = kShort.find(json[at]); k != std::string_view::npos) {
      text += kMeaning[k];
    } else if (json[at] == 'u' && at + 4 < json.size()) {
      std::uint32_t c = hexadecimal(json.substr(at + 1, 4));
      at += 4;
      if (c >= 0xD800 && c < 0xDC00 && json.substr(at + 1, 2) == "\\u") {
        c = 0x10000 + ((c - 0xD800) << 10) + (hexadecimal(json.substr(at + 3, 4)) - 0xDC00);
        at += 6;
      }
      append_code_point(text, c);
    }
  }
  ++at;
  return text;
}

/// Where the value of `key` begins, or npos.
std::size_t value_of(std::string_view json, std::string_view key) {
  const std::string quoted = fmt::format("\"{}\":", key);
  const std::size_t found = json.find(quoted);
  return found == std::string_view::npos ? found : json.find_first_not_of(" \n", found + quoted.size());
}

}  // namespace

std::vector<std::string> manifest_texts(std::string_view json, std::string_view key) {
  std::vector<std::string> texts;
  std::size_t at = value_of(json, key);
  int depth = 0;
  while (at < json.size()) {
    if (json[at] == '"') {
      texts.push_back(read_text(json, at));
    } else {
      depth += json[at] == '[' ? 1 : json[at] == ']' ? -1 : 0;
      ++at;
    }
    if (depth <= 0) break;
  }
  return texts;
}

std::optional<double> manifest_number(std::string_view json, std::string_view key) {
  const std::size_t at = value_of(json, key);
  if (at >= json.size()) return std::nullopt;
  const std::string text(json.substr(at, 40));
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  return end == text.c_str() ? std::nullopt : std::optional(value);
}

std::string fingerprint(std::string_view bytes) {
  static const auto table = [] {  // CRC-32 of ISO 3309, reflected polynomial
    std::array<std::uint32_t, 256> rows{};
    for (std::uint32_t n = 0; n < 256; ++n) {
      std::uint32_t c = n;
      for (int bit = 0; bit < 8; ++bit) c = c & 1 ? 0xEDB88320u ^ c >> 1 : c >> 1;
      rows[n] = c;
    }
    return rows;
  }();
  std::uint32_t crc = 0xFFFFFFFFu;
  for (const char byte : bytes) crc = table[(crc ^ static_cast<unsigned char>(byte)) & 0xFF] ^ crc >> 8;
  return fmt::format("{}-{:08x}", bytes.size(), crc ^ 0xFFFFFFFFu);
}

std::string changed_input(std::string_view json) {
  const std::vector<std::string> inputs = manifest_texts(json, "inputs");
  for (std::size_t i = 0; i + 1 < inputs.size(); i += 2) {
    const std::string& name = inputs[i];
    std::error_code error;
    const bool there = std::filesystem::is_regular_file(name, error);
    const bool was_there = inputs[i + 1] != "missing";
    if (there && !was_there) return name + " is there now";
    if (!there && was_there) return name + " is missing";
    if (there && fingerprint(read_file(name)) != inputs[i + 1]) return name + " has changed";
  }
  return {};
}

}  // namespace femxdem
