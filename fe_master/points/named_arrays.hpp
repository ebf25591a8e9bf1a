#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tensor.hpp"

namespace femxdem {

/// Named arrays of doubles: what an object gives to a checkpoint and takes back.
using NamedArrays = std::vector<std::pair<std::string, std::vector<double>>>;

/// The entry called `name`; throws std::out_of_range when there is none.
const std::vector<double>& find_array(const NamedArrays& arrays, const std::string& name);

/// Tensors as an array called `name`, and back to as many.
void add_tensors(NamedArrays& arrays, const std::string& name, std::span<const Tensor2> tensors);
void find_tensors(const NamedArrays& arrays, const std::string& name, std::span<Tensor2> tensors);

}  // namespace femxdem
