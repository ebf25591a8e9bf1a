// What schedule.hpp makes of recorded costs on any number of ranks: the load of the busiest rank in each batch.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "schedule.hpp"

namespace femxdem {
namespace {

/// Doubles of a file, batch after batch.
std::vector<double> read(const std::string& file) {
  std::ifstream stream(file, std::ios::binary | std::ios::ate);
  if (!stream) throw std::runtime_error(file + ": cannot be read");
  std::vector<double> values(static_cast<std::size_t>(stream.tellg()) / sizeof(double));
  stream.seekg(0);
  stream.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(values.size() * sizeof(double)));
  return values;
}

double largest(const std::vector<double>& values) { return *std::max_element(values.begin(), values.end()); }

/// Time of the busiest rank, whose threads take its points longest first, after what it has paid for moves.
double busiest(std::span<const double> costs, const std::vector<int>& owner, int ranks, int threads,
               const std::vector<double>& paid = {}) {
  std::vector<std::vector<double>> share(static_cast<std::size_t>(ranks));
  for (std::size_t p = 0; p < costs.size(); ++p) share[static_cast<std::size_t>(owner[p])].push_back(costs[p]);
  double most = 0;
  for (std::size_t rank = 0; rank < share.size(); ++rank) {
    most = std::max(
        most, (paid.empty() ? 0 : paid[rank]) + largest(loads(share[rank], assign(share[rank], threads), threads)));
  }
  return most;
}

struct Machine {
  int ranks = 1, threads = 1;  // of each rank
};

struct Policy {
  std::vector<double> busiest;  // of each batch
  std::size_t moved = 0;
};

/// As VolumeElements::balance does every `window` batches.
Policy balanced(const std::vector<double>& costs, std::size_t points, Machine machine, std::size_t window,
                MovePrice price) {
  Policy policy;
  std::vector<int> owner = assign(points, machine.ranks);
  std::vector<double> latest(points, 0.0), older(points, 0.0);
  for (std::size_t batch = 0; (batch + 1) * points <= costs.size(); ++batch) {
    const std::span<const double> now(costs.data() + batch * points, points);
    policy.busiest.push_back(busiest(now, owner, machine.ranks, machine.threads));
    for (std::size_t p = 0; p < points; ++p) latest[p] += now[p];
    if (window == 0 || (batch + 1) % window != 0) continue;
    const std::vector<int> next = rebalance(older, latest, owner, machine.ranks, price);
    for (std::size_t p = 0; p < points; ++p) policy.moved += next[p] != owner[p];
    owner = next;
    for (std::size_t p = 0; p < points; ++p) older[p] = (older[p] + std::exchange(latest[p], 0.0)) / 2;
  }
  return policy;
}

/// As VolumeElements::balance_each_step; a batch is a step, and what moves before it is in its time.
Policy each_step(const std::vector<double>& costs, std::size_t points, Machine machine, MovePrice price) {
  Policy policy;
  std::vector<int> owner = assign(points, machine.ranks);
  for (std::size_t batch = 0; (batch + 1) * points <= costs.size(); ++batch) {
    const std::span<const double> now(costs.data() + batch * points, points);
    const std::vector<int> next = batch == 0 ? owner : relieve(now, owner, machine.ranks, machine.threads * price);
    const std::vector<double> paid = moving(owner, next, machine.ranks, price);
    for (std::size_t p = 0; p < points; ++p) policy.moved += next[p] != owner[p];
    owner = next;
    policy.busiest.push_back(busiest(now, owner, machine.ranks, machine.threads, paid));
  }
  return policy;
}

/// Longest first by the costs of each batch itself, were moving free.
Policy foreseen(const std::vector<double>& costs, std::size_t points, Machine machine) {
  Policy policy;
  for (std::size_t batch = 0; (batch + 1) * points <= costs.size(); ++batch) {
    const std::span<const double> now(costs.data() + batch * points, points);
    policy.busiest.push_back(busiest(now, assign(now, machine.ranks), machine.ranks, machine.threads));
  }
  return policy;
}

void print(const char* name, const Policy& policy, const char* end) {
  fmt::print("\"{}\": {{\"moved\": {}, \"busiest\": [{:.17g}]}}{}\n", name, policy.moved,
             fmt::join(policy.busiest, ", "), end);
}

}  // namespace
}  // namespace femxdem

int main(int argc, char** argv) {
  using namespace femxdem;
  if (argc != 7) {
    std::cerr
        << "femxdem-schedule COSTS POINTS RANKS THREADS WINDOW STEP\n"
           "COSTS: doubles, one for each point of a batch, batch after batch; WINDOW: batches between checkpoints;\n"
           "STEP: cost of a DEM step of one point\n";
    return 2;
  }
  try {
    const std::vector<double> costs = read(argv[1]);
    const std::size_t points = std::stoul(argv[2]), window = std::stoul(argv[5]);
    const Machine machine{std::stoi(argv[3]), std::stoi(argv[4])};
    const double of_step = std::stod(argv[6]);
    fmt::print("{{\n");
    print("static", balanced(costs, points, machine, 0, {}), ",");
    print("balanced", balanced(costs, points, machine, window, of_step * kSceneMove), ",");
    print("each_step", each_step(costs, points, machine, of_step * kCellMove), ",");
    print("foreseen", foreseen(costs, points, machine), "");
    fmt::print("}}\n");
  } catch (const std::exception& error) {
    std::cerr << "femxdem-schedule: " << error.what() << "\n";
    return 2;
  }
  return 0;
}
