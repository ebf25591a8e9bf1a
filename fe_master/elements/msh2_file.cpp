#include "msh2_file.hpp"

#include <cstdint>
#include <cstring>
#include <fstream>
#include <sstream>
#include <vector>

namespace femxdem {
namespace {

using Groups = std::map<std::size_t, std::set<int>>;

/// Nodes of Gmsh's element types 1 to 31 (reference manual, "Low order elements" and the rest), 0: not there.
constexpr int kNodes[] = {0, 2,  3,  4,  4, 8,  6,  5,  3,  6,  9, 10, 27, 18, 14, 1,
                          8, 20, 15, 13, 9, 10, 12, 15, 15, 21, 4, 5,  6,  20, 35, 56};

/// Names between $PhysicalNames and its end: text in files of every kind.
void read_names(std::istream& stream, MshGroups& found) {
  int count = 0;
  stream >> count;
  for (std::string line; count > 0 && std::getline(stream, line);) {
    std::istringstream words(line);
    int dimension = 0, tag = 0;
    const auto first = line.find('"'), last = line.rfind('"');
    if (!(words >> dimension >> tag) || first == last) continue;
    found.names[{dimension, tag}] = line.substr(first + 1, last - first - 1);
    --count;
  }
}

Groups read_text_elements(std::istream& stream) {
  Groups groups;
  std::size_t count = 0;
  stream >> count >> std::ws;
  for (std::string line; count > 0 && std::getline(stream, line); --count) {
    std::istringstream words(line);
    std::size_t tag = 0;
    int type = 0, tags = 0, group = 0;
    if (words >> tag >> type >> tags && tags > 0 && words >> group && group != 0) groups[tag].insert(group);
  }
  return groups;
}

/// Blocks of (type, elements, tags) and, of each element, its number, tags and nodes; all of them int of `swapped`
/// order.
Groups read_binary_elements(std::istream& stream, bool swapped) {
  Groups groups;
  const auto integer = [&] {
    std::uint32_t x = 0;
    stream.read(reinterpret_cast<char*>(&x), sizeof x);
    return static_cast<int>(swapped ? __builtin_bswap32(x) : x);
  };
  std::size_t left = 0;
  stream >> left;
  stream.get();
  while (left > 0 && stream) {
    const int type = integer(), elements = integer(), tags = integer();
    if (type < 1 || type > 31 || elements < 1) break;
    for (int e = 0; e < elements && stream; ++e, --left) {
      const auto number = static_cast<std::size_t>(integer());
      for (int t = 0; t < tags; ++t)
        if (const int group = integer(); t == 0 && group != 0) groups[number].insert(group);
      for (int n = 0; n < kNodes[type]; ++n) integer();
    }
  }
  return groups;
}

}  // namespace

MshGroups read_msh_groups(const std::string& file) {
  MshGroups found;
  std::ifstream stream(file, std::ios::binary);
  double version = 0;
  int binary = 0, size = 0;
  bool swapped = false;
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with("$MeshFormat")) {
      stream >> version >> binary >> size;
      stream.get();
      std::int32_t one = 1;
      if (binary == 1) stream.read(reinterpret_cast<char*>(&one), sizeof one);
      swapped = one != 1;
    } else if (line.starts_with("$PhysicalNames")) {
      read_names(stream, found);
    } else if (line.starts_with("$Elements") && version >= 2 && version < 3) {
      found.groups = binary == 1 ? read_binary_elements(stream, swapped) : read_text_elements(stream);
    }
  }
  return found;
}

}  // namespace femxdem
