#pragma once

#include <map>
#include <string>
#include <vector>

namespace femxdem {

/// Nearest of the candidates to a misspelt word (edit distance up to a third of its length, at least 2), or empty.
std::string nearest(const std::string& word, const std::vector<std::string>& candidates);

/// All mistakes of a case, one line each, and where every key of the case file stands.
class Mistakes {
 public:
  explicit Mistakes(std::string file) : file_(std::move(file)) {}
  /// Notes that the dotted key ("mesh.nx", "load.0.value", or a table "load.0") was found at `place` ("file:line:col").
  void found(const std::string& key, const std::string& place) { places_[key] = place; }
  /// Whether the case file has this key, right or wrong.
  bool has(const std::string& key) const { return places_.count(key) > 0; }
  /// Place of the key, or of the nearest table around it, or the file.
  std::string place(const std::string& key) const;
  /// Adds `place: sentence`.
  void add(const std::string& key, const std::string& sentence);
  bool empty() const { return lines_.empty(); }
  /// Whether a mistake was added at this key or below it.
  bool wrong(const std::string& key) const;
  /// All lines, in the order of the checks.
  std::string text() const;

 private:
  std::string file_;
  std::map<std::string, std::string> places_;
  std::vector<std::string> wrong_;
  std::vector<std::string> lines_;
};

}  // namespace femxdem
