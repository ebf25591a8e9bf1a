#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "case.hpp"
#include "case_mistakes.hpp"
#include "mesh.hpp"

namespace femxdem {

/// Adds what is missing or contradictory between parameters. Builds the mesh, where it can, to know its edges.
void check_case(const Case& c, Purpose purpose, Mistakes& mistakes);

/// The part of check_case that concerns [[load]]; without a mesh its edges are not known.
void check_loads(const Case& c, const std::optional<std::set<std::string>>& edges, Mistakes& mistakes);

/// Axisymmetric elements: an edge on the axis x = 0 has no radial displacement, which a load must say.
void check_axis(const Case& c, const Mesh& mesh, Mistakes& mistakes);

/// Adds a mistake for each key of a section that the file does not have.
void require(Mistakes& mistakes, const std::string& section, const std::vector<std::string>& keys,
             const std::string& reason);

/// Adds a mistake at `key` if the name of an edge or region is not among the known ones.
void require_known(const std::string& name, const std::set<std::string>& known, const std::string& noun,
                   const std::string& key, Mistakes& mistakes);

}  // namespace femxdem
