#include "case_mistakes.hpp"

#include <algorithm>
#include <numeric>

namespace femxdem {

namespace {

/// Optimal string alignment distance: insertions, deletions, substitutions, exchanges of neighbours.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = a[i - 1] == b[j - 1] ? 0 : 1;
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + change});
      const bool exchanged = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (exchanged) d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

}  // namespace

std::string nearest(const std::string& word, const std::vector<std::string>& candidates) {
  std::string best;
  std::size_t least = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t distance = edit_distance(word, candidate);
    if (distance < least && distance < candidate.size()) {
      least = distance;
      best = candidate;
    }
  }
  return best;
}

std::string Mistakes::place(const std::string& key) const {
  std::string around = key;
  while (!around.empty() && !has(around)) {
    const std::size_t dot = around.rfind('.');
    around = dot == std::string::npos ? "" : around.substr(0, dot);
  }
  return around.empty() ? file_ : places_.at(around);
}

void Mistakes::add(const std::string& key, const std::string& sentence) {
  wrong_.push_back(key);
  lines_.push_back(place(key) + ": " + sentence);
}

bool Mistakes::wrong(const std::string& key) const {
  return std::any_of(wrong_.begin(), wrong_.end(),
                     [&key](const std::string& w) { return w == key || w.rfind(key + ".", 0) == 0; });
}

std::string Mistakes::text() const {
  return std::accumulate(
      lines_.begin(), lines_.end(), std::string(),
      [](const std::string& all, const std::string& line) { return all.empty() ? line : all + "\n" + line; });
}

}  // namespace femxdem
