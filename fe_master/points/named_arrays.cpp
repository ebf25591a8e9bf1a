#include "named_arrays.hpp"

#include <stdexcept>

namespace femxdem {

const std::vector<double>& find_array(const NamedArrays& arrays, const std::string& name) {
  for (const auto& [key, values] : arrays) {
    if (key == name) return values;
  }
  throw std::out_of_range("checkpoint has no array " + name);
}

}  // namespace femxdem
