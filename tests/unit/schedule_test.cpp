#include "schedule.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

namespace femxdem {
namespace {

double busiest(const std::vector<double>& costs, const std::vector<int>& owner, int ranks) {
  const std::vector<double> sums = loads(costs, owner, ranks);
  return *std::max_element(sums.begin(), sums.end());
}

/// Of all assignments, by trying them.
double optimum(const std::vector<double>& costs, int ranks) {
  std::vector<int> owner(costs.size(), 0);
  double least = std::numeric_limits<double>::infinity();
  for (;;) {
    least = std::min(least, busiest(costs, owner, ranks));
    std::size_t digit = 0;
    while (digit < owner.size() && ++owner[digit] == ranks) owner[digit++] = 0;
    if (digit == owner.size()) return least;
  }
}

/// Whole numbers, as counted costs are: their sums are exact.
std::vector<double> random_costs(std::size_t count, unsigned seed) {
  std::mt19937 generator(seed);
  std::vector<double> costs;
  for (std::size_t i = 0; i < count; ++i) costs.push_back(std::floor(std::exp(1 + 2e-9 * generator())));
  return costs;
}

std::size_t moved(const std::vector<int>& a, const std::vector<int>& b) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) count += a[i] != b[i];
  return count;
}

TEST(Schedule, LongestFirstIsWithinGrahamsBoundOfTheOptimum) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    const int ranks = 2 + static_cast<int>(seed % 2);
    const std::vector<double> costs = random_costs(8, seed);
    const double found = busiest(costs, assign(costs, ranks), ranks), best = optimum(costs, ranks);
    EXPECT_GE(found, best);
    EXPECT_LE(found, (4.0 / 3 - 1.0 / (3 * ranks)) * best) << "seed " << seed;
  }
}

// Graham's own example: the bound is met.
TEST(Schedule, GrahamsWorstCase) {
  const std::vector<double> costs = {5, 5, 4, 4, 3, 3, 3};
  EXPECT_EQ(optimum(costs, 3), 9);
  EXPECT_EQ(busiest(costs, assign(costs, 3), 3), 11) << "(4/3 - 1/9) 9";
}

TEST(Schedule, TiesGoByIndexAndNumber) {
  EXPECT_EQ(assign(std::vector<double>(5, 7.0), 2), (std::vector<int>{0, 1, 0, 1, 0}));
  EXPECT_EQ(assign(std::vector<double>{1, 4, 4, 1}, 2), (std::vector<int>{0, 0, 1, 1}));
}

TEST(Schedule, FewerPointsThanRanksAndPointsWithoutCost) {
  EXPECT_EQ(assign(std::vector<double>{1, 2}, 4), (std::vector<int>{1, 0}));
  EXPECT_EQ(assign(std::vector<double>{}, 2), std::vector<int>{});
  EXPECT_EQ(imbalance(loads(std::vector<double>(3, 0.0), std::vector<int>{0, 0, 0}, 2)), 1);
  const std::vector<int> owner = {0, 0, 0};
  EXPECT_EQ(reassign(std::vector<double>(3, 0.0), owner, 2, 0.1), owner) << "nothing is gained by moving them";
  EXPECT_THROW(assign(std::vector<double>{1}, 0), std::invalid_argument);
}

TEST(Schedule, WhatIsBalancedStays) {
  const std::vector<double> costs = random_costs(200, 1);
  const std::vector<int> owner = assign(costs, 7);
  EXPECT_EQ(reassign(costs, owner, 7, 0.02), owner);
}

TEST(Schedule, OneDearPointMakesOneMove) {
  std::vector<double> costs(20, 10);
  costs[0] = costs[2] = 50;  // both on rank 0 of two: 180 and 100
  const std::vector<int> owner = assign(costs.size(), 2);
  const std::vector<int> after = reassign(costs, owner, 2, 0.1);
  EXPECT_EQ(moved(owner, after), 1u);
  EXPECT_LE(imbalance(loads(costs, after, 2)), 1.1);
}

TEST(Schedule, ReassignedLoadsAreWithinTheToleranceForFewerMovesThanAnew) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const int ranks = 16;
    const std::vector<double> costs = random_costs(640, seed);
    const std::vector<int> owner = assign(costs.size(), ranks), anew = assign(costs, ranks);
    const std::vector<int> after = reassign(costs, owner, ranks, 0.02);
    const double limit = std::max(1.02, imbalance(loads(costs, anew, ranks)));
    EXPECT_GT(imbalance(loads(costs, owner, ranks)), limit) << "there is something to do";
    EXPECT_LE(imbalance(loads(costs, after, ranks)), limit * (1 + 1e-12));
    EXPECT_LT(2 * moved(owner, after), moved(owner, anew));
  }
}

TEST(Schedule, PointsMoveOnlyWhereThatPays) {
  const std::vector<double> costs = {10, 10, 10, 10};
  const std::vector<int> owner = {0, 0, 0, 1};  // one move takes 10 off the busiest
  EXPECT_EQ(rebalance(costs, costs, owner, 2, {11, 11}), owner);
  EXPECT_EQ(moved(rebalance(costs, costs, owner, 2, {9, 9}), owner), 1u);
}

TEST(Schedule, RanksMovePointsSideBySide) {
  const std::vector<double> costs(8, 10.0);
  const std::vector<int> owner = {0, 0, 0, 1, 1, 1, 2, 3};  // two moves, each of another pair of ranks, take 10 off
  EXPECT_EQ(moved(rebalance(costs, costs, owner, 4, {9, 9}), owner), 2u);
}

TEST(Schedule, CostsThatDoNotTellThoseToComeMoveNothing) {
  const std::vector<double> older = {10, 10, 10, 10}, latest = {1, 1, 1, 27};
  const std::vector<int> owner = {0, 0, 0, 1};  // by the older costs a point would go to rank 1
  EXPECT_EQ(rebalance(older, latest, owner, 2, {0, 0}), owner);
  EXPECT_EQ(rebalance(std::vector<double>(4, 0.0), latest, owner, 2, {0, 0}), owner) << "nothing is known yet";
}

TEST(Schedule, RelievesTheBusiestRankByThePointThatLeavesLeast) {
  const std::vector<double> costs = {8, 4, 3, 1, 2};
  const std::vector<int> owner = {0, 0, 0, 0, 1};  // 16 | 2: 3 leaves 13, 4 leaves 12, 8 leaves 10 for the other
  EXPECT_EQ(relieve(costs, owner, 2, {}), (std::vector<int>{1, 0, 0, 0, 1}));
  EXPECT_EQ(relieve(costs, owner, 2, {5.9, 5.9}), (std::vector<int>{1, 0, 0, 0, 1}));
  EXPECT_EQ(relieve(costs, owner, 2, {6, 6}), owner) << "10 and the price is what it had";
  EXPECT_EQ(relieve(costs, owner, 2, {3, 0}), (std::vector<int>{1, 0, 0, 0, 1})) << "11 and 10 are left";
  EXPECT_EQ(relieve(costs, owner, 2, {0, 3}), (std::vector<int>{0, 1, 0, 0, 1})) << "12 and 9, not 8 and 13";
  EXPECT_EQ(moving(owner, std::vector<int>{1, 1, 0, 0, 0}, 2, {7, 2}), (std::vector<double>{16, 11}));
  EXPECT_EQ(relieve(costs, std::vector<int>(5, 0), 1, {}), std::vector<int>(5, 0));
  EXPECT_EQ(relieve(std::vector<double>(5, 0.0), owner, 2, {}), owner);
}

TEST(Schedule, RelievesRanksOfARecordedBandAsFarAsThePriceAllows) {
  std::vector<double> costs;  // every tenth point costs eight times the rest, dealt in turn to 64 ranks
  std::mt19937 generator(1);
  for (int p = 0; p < 64 * 20; ++p) costs.push_back((generator() % 10 == 0 ? 80 : 10) + generator() % 5);
  const std::vector<int> owner = assign(costs.size(), 64);
  const auto after = [&](double price) {
    return imbalance(loads(costs, relieve(costs, owner, 64, {price, price}), 64));
  };
  EXPECT_GT(imbalance(loads(costs, owner, 64)), 1.5);
  EXPECT_LT(after(0), 1.06);
  EXPECT_LT(after(20), after(60));
  EXPECT_EQ(after(1e4), imbalance(loads(costs, owner, 64)));
}

// 5 5 | 3 3: no single point of the first rank fits into the second below 8, 5 3 | 5 3 does.
TEST(Schedule, StartsAnewWhereNoPointFits) {
  const std::vector<double> costs = {5, 5, 3, 3};
  const std::vector<int> after = reassign(costs, {0, 0, 1, 1}, 2, 0.0);
  EXPECT_EQ(after, assign(costs, 2));
  EXPECT_EQ(imbalance(loads(costs, after, 2)), 1);
}

}  // namespace
}  // namespace femxdem
