#include "named_arrays.hpp"

#include <algorithm>
#include <stdexcept>

namespace femxdem {

const std::vector<double>& find_array(const NamedArrays& arrays, const std::string& name) {
  for (const auto& [key, values] : arrays) {
    if (key == name) return values;
  }
  throw std::out_of_range("checkpoint has no array " + name);
}

void add_tensors(NamedArrays& arrays, const std::string& name, std::span<const Tensor2> tensors) {
  std::vector<double> values;
  for (const Tensor2& T : tensors) values.insert(values.end(), T.data(), T.data() + 9);
  arrays.emplace_back(name, std::move(values));
}

void find_tensors(const NamedArrays& arrays, const std::string& name, std::span<Tensor2> tensors) {
  const std::vector<double>& values = find_array(arrays, name);
  for (std::size_t i = 0; i < tensors.size(); ++i) std::copy_n(&values.at(9 * i), 9, tensors[i].data());
}

}  // namespace femxdem
