#pragma once

#include <string>
#include <utility>
#include <vector>

namespace femxdem {

/// Named arrays of doubles: what an object gives to a checkpoint and takes back.
using NamedArrays = std::vector<std::pair<std::string, std::vector<double>>>;

/// The entry called `name`; throws std::out_of_range when there is none.
const std::vector<double>& find_array(const NamedArrays& arrays, const std::string& name);

}  // namespace femxdem
