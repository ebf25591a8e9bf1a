#include "schedule.hpp"

#include <algorithm>
#include <numeric>
#include <set>
#include <stdexcept>
#include <utility>

namespace femxdem {
namespace {

constexpr double kBalanced = 0.02;  // of the mean, by which the busiest rank may have more

/// Ranks in order of their loads, then of their numbers.
using Ranking = std::set<std::pair<double, int>>;

void require_ranks(int ranks) {
  if (ranks < 1) throw std::invalid_argument("assign: at least one rank is needed");
}

std::vector<std::size_t> dearest_first(std::span<const double> costs) {
  std::vector<std::size_t> order(costs.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return costs[a] > costs[b]; });
  return order;
}

Ranking ranking(std::span<const double> loads) {
  Ranking ranks;
  for (std::size_t r = 0; r < loads.size(); ++r) ranks.emplace(loads[r], static_cast<int>(r));
  return ranks;
}

double busiest(std::span<const double> loads) { return *std::max_element(loads.begin(), loads.end()); }

double mean(std::span<const double> loads) {
  return std::accumulate(loads.begin(), loads.end(), 0.0) / static_cast<double>(loads.size());
}

}  // namespace

std::vector<int> assign(std::size_t points, int ranks) {
  require_ranks(ranks);
  std::vector<int> owner(points);
  for (std::size_t i = 0; i < points; ++i) owner[i] = static_cast<int>(i % static_cast<std::size_t>(ranks));
  return owner;
}

std::vector<int> assign(std::span<const double> costs, int ranks) {
  require_ranks(ranks);
  Ranking idlest = ranking(std::vector<double>(static_cast<std::size_t>(ranks), 0.0));
  std::vector<int> owner(costs.size());
  for (const std::size_t point : dearest_first(costs)) {
    auto rank = idlest.extract(idlest.begin());
    owner[point] = rank.value().second;
    rank.value().first += costs[point];
    idlest.insert(std::move(rank));
  }
  return owner;
}

std::vector<int> reassign(std::span<const double> costs, std::vector<int> owner, int ranks, double tolerance) {
  const std::vector<int> anew = assign(costs, ranks);
  const double least = busiest(loads(costs, anew, ranks));
  const std::vector<double> now = loads(costs, owner, ranks);
  const double limit = std::max((1 + tolerance) * mean(now), least);
  std::vector<std::vector<std::size_t>> points(static_cast<std::size_t>(ranks));  // of each rank, the dearest first
  for (const std::size_t point : dearest_first(costs)) points[static_cast<std::size_t>(owner[point])].push_back(point);
  Ranking order = ranking(now);
  while (order.rbegin()->first > limit) {
    auto giver = order.extract(std::prev(order.end())), taker = order.extract(order.begin());
    auto& candidates = points[static_cast<std::size_t>(giver.value().second)];
    const double room = limit - taker.value().first;
    const auto given = std::find_if(candidates.begin(), candidates.end(),
                                    [&](std::size_t point) { return costs[point] > 0 && costs[point] <= room; });
    if (given == candidates.end()) return giver.value().first > least ? anew : owner;
    owner[*given] = taker.value().second;
    giver.value().first -= costs[*given];
    taker.value().first += costs[*given];
    candidates.erase(given);  // the taker stays below the limit: it gives nothing
    order.insert(std::move(giver));
    order.insert(std::move(taker));
  }
  return owner;
}

std::vector<int> rebalance(std::span<const double> older, std::span<const double> latest, const std::vector<int>& owner,
                           int ranks, MovePrice price) {
  const std::vector<int> then = reassign(older, owner, ranks, kBalanced);
  const double gain = busiest(loads(latest, owner, ranks)) - busiest(loads(latest, then, ranks));
  if (gain <= busiest(moving(owner, then, ranks, price))) return owner;
  std::vector<double> all(older.begin(), older.end());
  for (std::size_t p = 0; p < all.size(); ++p) all[p] += latest[p];
  return reassign(all, owner, ranks, kBalanced);
}

std::vector<int> relieve(std::span<const double> costs, std::vector<int> owner, int ranks, MovePrice price) {
  const std::vector<double> now = loads(costs, owner, ranks);
  const double limit = (1 + kBalanced) * mean(now);
  std::vector<std::vector<std::size_t>> points(static_cast<std::size_t>(ranks));  // of each rank, the dearest first
  for (const std::size_t point : dearest_first(costs)) points[static_cast<std::size_t>(owner[point])].push_back(point);
  Ranking order = ranking(now);
  while (order.size() > 1 && order.rbegin()->first > limit) {
    auto giver = order.extract(std::prev(order.end())), taker = order.extract(order.begin());
    auto& candidates = points[static_cast<std::size_t>(giver.value().second)];
    const auto left = [&](std::size_t point) {
      return std::max(giver.value().first - costs[point] + price.give, taker.value().first + costs[point] + price.take);
    };
    const double half = (giver.value().first + price.give - taker.value().first - price.take) / 2;
    auto given =
        std::partition_point(candidates.begin(), candidates.end(), [&](std::size_t p) { return costs[p] > half; });
    if (given != candidates.begin() && (given == candidates.end() || left(*std::prev(given)) < left(*given))) --given;
    if (given == candidates.end() || left(*given) >= giver.value().first) return owner;
    owner[*given] = taker.value().second;
    giver.value().first += price.give - costs[*given];
    taker.value().first += price.take + costs[*given];
    candidates.erase(given);  // what is taken stays
    order.insert(std::move(giver));
    order.insert(std::move(taker));
  }
  return owner;
}

std::vector<double> moving(std::span<const int> before, std::span<const int> after, int ranks, MovePrice price) {
  std::vector<double> paid(static_cast<std::size_t>(ranks), 0.0);
  for (std::size_t p = 0; p < before.size(); ++p) {
    if (after[p] == before[p]) continue;
    paid[static_cast<std::size_t>(before[p])] += price.give;
    paid[static_cast<std::size_t>(after[p])] += price.take;
  }
  return paid;
}

std::vector<double> loads(std::span<const double> costs, std::span<const int> owner, int ranks) {
  require_ranks(ranks);
  std::vector<double> sums(static_cast<std::size_t>(ranks), 0.0);
  for (std::size_t p = 0; p < costs.size(); ++p) sums[static_cast<std::size_t>(owner[p])] += costs[p];
  return sums;
}

double imbalance(std::span<const double> loads) {
  const double average = mean(loads);
  return average > 0 ? busiest(loads) / average : 1;
}

}  // namespace femxdem
