#pragma once

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <stdexcept>
#include <string>
#include <vector>

namespace femxdem {

/// A case that must be refused: what it changes in a base, and what is said of it.
struct BadCase {
  std::map<int, std::string> left_out;    ///< by the number of the line in the base, from 1: what it reads there
  std::multimap<int, std::string> added;  ///< by the number of the base's line below which it stands
  std::vector<std::string> expected;      ///< "LINE:COLUMN: sentence" of the changed case
};

inline std::vector<std::string> lines_of(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream) throw std::runtime_error(file.string() + ": cannot be read");
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

/// tests/cases/bad.txt, which tells its format, by the names of the cases. Throws std::runtime_error at a line that is
/// no change and no sentence.
inline std::map<std::string, BadCase> read_bad_cases(const std::filesystem::path& file) {
  static const std::regex change("([0-9]+) ([-+]) ?(.*)"), sentence("[0-9]+:[0-9]+: .+"), name("[A-Za-z0-9_]+");
  std::map<std::string, BadCase> cases;
  BadCase* one = nullptr;
  for (const std::string& line : lines_of(file)) {
    std::smatch part;
    if (line.empty()) {
      one = nullptr;
    } else if (one == nullptr && std::regex_match(line, name)) {
      one = &cases[line];
    } else if (one != nullptr && std::regex_match(line, part, change)) {
      const int number = std::stoi(part[1]);
      if (part[2] == "+")
        one->added.emplace(number, part[3]);
      else
        one->left_out.emplace(number, part[3]);
    } else if (one != nullptr && std::regex_match(line, sentence)) {
      one->expected.push_back(line);
    } else if (!cases.empty()) {
      throw std::runtime_error(file.string() + ": neither a change nor a sentence: " + line);
    }
  }
  return cases;
}

/// The text of the case. Throws std::runtime_error where a line that is left out reads otherwise in the base.
inline std::string changed(const std::vector<std::string>& base, const BadCase& bad) {
  std::string text;
  for (int number = 1; number <= static_cast<int>(base.size()); ++number) {
    const std::string& line = base[number - 1];
    const auto left_out = bad.left_out.find(number);
    if (left_out == bad.left_out.end()) {
      text += line + "\n";
    } else if (left_out->second != line) {
      throw std::runtime_error("line " + std::to_string(number) + " of the base is \"" + line + "\"");
    }
    const auto [first, last] = bad.added.equal_range(number);
    for (auto added = first; added != last; ++added) text += added->second + "\n";
  }
  return text;
}

}  // namespace femxdem
