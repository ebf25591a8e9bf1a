#include "schedule.hpp"

#include <stdexcept>

namespace femxdem {

std::vector<int> assign(std::size_t points, int ranks) {
  if (ranks < 1) throw std::invalid_argument("assign: at least one rank is needed");
  std::vector<int> owner(points);
  for (std::size_t i = 0; i < points; ++i) owner[i] = static_cast<int>(i % static_cast<std::size_t>(ranks));
  return owner;
}

}  // namespace femxdem
