#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace femxdem {

/// Values of one quantity at all nodes or at all Gauss points: `components` numbers each, tensors row by row.
struct Field {
  std::string name;
  std::size_t components = 1;
  std::vector<double> values;
};

}  // namespace femxdem
