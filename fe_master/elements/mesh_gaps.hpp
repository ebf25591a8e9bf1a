#pragma once

#include <string>

#include "mesh.hpp"

namespace femxdem {

/// Throws UserError where elements that touch are not joined: pairs of nodes at one place, counted, or a node that is a
/// corner of one element and the middle of another's side, or a side that more than two elements share. `file`: whose
/// mesh it is.
void refuse_gaps(const Mesh& mesh, const std::string& file);

}  // namespace femxdem
