#pragma once

#include <iosfwd>

#include "material_points.hpp"

namespace femxdem {

/// Answers one volume element's strains, line by line, until `questions` ends; femxdem.py is the other side.
///
///     evaluate f11 f12 ... f33    "= answer s11 s12 ... s33 report..." [Pa], or "= failed SENTENCE"
///     stiffness f11 ... f33       the same, and then the 81 components of Eq. (2), c1111 c1112 ... c3333 [Pa]
///     commit                      "= done report...": the last answer's state is where the next strain starts; its
///                                 report is now complete
///
/// First comes "= fields" with the names of a report. Numbers have 17 digits. Anything else is "= failed".
void serve_volume_element(LocalPoints& point, std::istream& questions, std::ostream& answers);

}  // namespace femxdem
