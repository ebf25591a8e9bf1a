#pragma once

#include <cstddef>
#include <vector>

namespace femxdem {

/// Rank of each of `points` points: cyclically, 0, 1, ..., ranks - 1, 0, 1, ... Throws std::invalid_argument if ranks
/// < 1.
std::vector<int> assign(std::size_t points, int ranks);

}  // namespace femxdem
