#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

namespace femxdem {

/// What a Gmsh file of format 2 says of its physical groups and Gmsh's library forgets: it keeps groups for each
/// elementary entity, not for each element, and one group of each name.
struct MshGroups {
  std::map<std::pair<int, int>, std::string> names;            ///< (dimension, tag) of a group; of every .msh format
  std::optional<std::map<std::size_t, std::set<int>>> groups;  ///< of an element's tag; none: not of format 2
};

/// Reads names and groups of a .msh file; empty where it is of another kind.
MshGroups read_msh_groups(const std::string& file);

}  // namespace femxdem
