#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace femxdem {

/// Rank of each of `points` points: cyclically, 0, 1, ..., ranks - 1, 0, 1, ... Throws std::invalid_argument if ranks
/// < 1, as do all of these.
std::vector<int> assign(std::size_t points, int ranks);

/// Rank of each point by its cost (>= 0): the dearest first, each to the rank that has least so far (Graham 1969). The
/// busiest rank has at most 4/3 - 1/(3 ranks) of what it has in the best assignment. Of equal costs the lower index
/// comes first, of equally loaded ranks the lower number.
std::vector<int> assign(std::span<const double> costs, int ranks);

/// Assignment that keeps what need not move: as long as the busiest rank has more than (1 + tolerance) of the mean (or
/// than assign(costs, ranks) gives it, where that is more), its dearest point for which the idlest rank has room below
/// that goes there. Where none has, the better of this and assign(costs, ranks).
std::vector<int> reassign(std::span<const double> costs, std::vector<int> owner, int ranks, double tolerance);

/// What a rank is kept from its trials by each point that it gives, and that it takes.
struct MovePrice {
  double give = 0, take = 0;
};
inline MovePrice operator*(double cost, MovePrice price) { return {cost * price.give, cost * price.take}; }

/// In DEM steps of the point: of 1000 spheres, which YADE takes 0.1 to 0.2 s to save or to restore, where a step takes
/// 1.4 ms; of any engine at most.
inline constexpr MovePrice kSceneMove{70, 70};
/// Of a compact cell, which goes to another rank in the time of 17 (1000 spheres) to 26 (200) of its steps
/// (bridge_benchmark moves of validation/engine).
inline constexpr MovePrice kCellMove{14, 12};

/// What pays: reassign() of older and latest costs together, to 2 % of the mean, where that of the older costs alone
/// would have taken more off the busiest rank in the latest than the moves cost that take longest, the ranks side by
/// side; else `owner`.
/// Costs that do not tell those to come move nothing: dealing in turn spreads a band over all ranks, and is hard to
/// beat by costs that change by a quarter from step to step (validation/scaling).
std::vector<int> rebalance(std::span<const double> older, std::span<const double> latest, const std::vector<int>& owner,
                           int ranks, MovePrice price);

/// What pays where the costs are those to come: a point at a time goes from the busiest rank to the idlest, the one
/// that leaves both with least, as long as that takes something off the busiest, which has more than 2 % above the
/// mean.
std::vector<int> relieve(std::span<const double> costs, std::vector<int> owner, int ranks, MovePrice price);

/// What each rank pays for what it gives and takes.
std::vector<double> moving(std::span<const int> before, std::span<const int> after, int ranks, MovePrice price);

/// Cost of all points of each rank.
std::vector<double> loads(std::span<const double> costs, std::span<const int> owner, int ranks);

/// Load of the busiest rank over the mean; 1 where nothing costs anything.
double imbalance(std::span<const double> loads);

}  // namespace femxdem
