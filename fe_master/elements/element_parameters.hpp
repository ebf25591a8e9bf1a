#pragma once

#include <vector>

#include "given.hpp"

namespace femxdem {

enum class ElementType { q8, second_gradient, axisymmetric };
struct ElementParameters {
  ElementType type = ElementType::q8;
  double D = kNotGiven;         ///< second-gradient modulus, formulation with one parameter [N]
  std::vector<double> mindlin;  ///< a1..a5 of the general isotropic law instead of D [N], or empty
};

}  // namespace femxdem
