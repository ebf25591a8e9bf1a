#pragma once

#include <vector>

namespace femxdem {

/// Components of strain that a formulation can produce, in Mandel form: index 0 to 5 is 11, 22, 33, 23, 13, 12.
using StrainComponents = std::vector<int>;
/// Plane strain: 11, 22, 12.
inline const StrainComponents kPlaneStrain = {0, 1, 5};

}  // namespace femxdem
