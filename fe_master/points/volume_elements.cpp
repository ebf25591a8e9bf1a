#include "volume_elements.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <exception>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "packet.hpp"
#include "rank_service.hpp"
#include "schedule.hpp"
#include "seconds_since.hpp"

namespace femxdem {

using namespace ranks;

namespace {

constexpr double kMostlyDistinct = 0.9;  // of the points: where fewer histories differ, points share cells

/// Points of each rank, in order.
std::vector<std::vector<std::size_t>> shares(const std::vector<int>& owner, int ranks) {
  std::vector<std::vector<std::size_t>> points(static_cast<std::size_t>(ranks));
  for (std::size_t p = 0; p < owner.size(); ++p) points[static_cast<std::size_t>(owner[p])].push_back(p);
  return points;
}

/// Input of each rank: the same head, then the F of its points.
std::vector<std::string> gradients(std::span<const Tensor2> F, const std::vector<std::vector<std::size_t>>& shares,
                                   const std::string& head = {}) {
  std::vector<std::string> inputs;
  for (const auto& share : shares) {
    PacketWriter packet;
    for (const std::size_t point : share) packet.put_doubles(F[point].data(), 9);
    inputs.push_back(head + packet.take());
  }
  return inputs;
}

/// Of one trial; 0 where a law makes no steps.
double cost(const PointReport& report) {
  const double steps = report["dem_steps"];
  return std::isfinite(steps) ? trial_cost(steps, report["contacts"]) : 0;
}

}  // namespace

VolumeElements::VolumeElements(MPI_Comm communicator, LocalPoints& local, const std::vector<std::string>& templates,
                               const std::vector<int>& template_of_point)
    : communicator_(communicator),
      local_(local),
      shares_(shares(assign(template_of_point.size(), size_of(communicator)), size_of(communicator))),
      latest_(template_of_point.size(), 0.0),
      older_(template_of_point.size(), 0.0),
      histories_(std::span<const int>(template_of_point)),
      distinct_(template_of_point.size()) {
  std::vector<std::string> inputs;
  for (const auto& points : shares_) {
    PacketWriter packet;
    packet.put(templates.size());
    for (const std::string& state : templates) packet.put(state);
    packet.put(points.size());
    for (const std::size_t point : points) packet.put(template_of_point[point]);
    inputs.push_back(packet.take());
  }
  try {
    command(communicator_, Order::add, inputs, local_);
  } catch (const std::exception&) {
    command(communicator_, Order::end, {}, local_);
    throw;
  }
}

VolumeElements::~VolumeElements() { command(communicator_, Order::end, {}, local_); }

void VolumeElements::begin_step() {
  command(communicator_, Order::begin_step, {}, local_);
  if (trials_of_step_ > 0) trials_of_last_step_ = std::exchange(trials_of_step_, 0);
}

std::vector<Response> VolumeElements::evaluate(std::span<const Tensor2> F, Operator wanted) {
  if (F.size() != size()) throw std::invalid_argument("evaluate: one deformation gradient per point");
  const auto start = std::chrono::steady_clock::now();
  if (each_step_ && trials_of_step_ == 0) relieve_ranks(F);
  ++trials_of_step_;
  PacketWriter head;
  head.put(static_cast<int>(wanted));
  const std::vector<std::string> inputs = gradients(F, shares_, head.take());
  const std::vector<std::string> answers = command(communicator_, Order::evaluate, inputs, local_);
  std::vector<Response> responses(size());
  for (std::size_t rank = 0; rank < shares_.size(); ++rank) {
    PacketReader packet(answers[rank]);
    for (const std::size_t point : shares_[rank])
      responses[point] = get_response(packet, wanted != Operator::none, point);
    if (rank > 0) statistics_.bytes += inputs[rank].size() + answers[rank].size();
  }
  distinct_ = histories_.trial(F);
  count(responses, seconds_since(start));
  return responses;
}

void VolumeElements::count(const std::vector<Response>& responses, double seconds) {
  ++statistics_.batches;
  statistics_.evaluations += static_cast<long>(responses.size());
  statistics_.seconds += seconds;
  for (const Response& response : responses) {
    statistics_.dem_steps += response.report["dem_steps"];
    statistics_.trial_seconds += response.report["seconds"];
    statistics_.engine_seconds += response.report["engine_seconds"];
  }
  double busiest = 0, longest = 0;
  for (const auto& share : shares_) {
    double load = 0, taken = 0;
    for (const std::size_t point : share) {
      const double of_trial = cost(responses[point].report);
      latest_[point] += of_trial;
      load += of_trial;
      taken += responses[point].report["seconds"];
    }
    busiest = std::max(busiest, load);
    longest = std::max(longest, taken);
    statistics_.cost += load;
  }
  statistics_.critical_cost += busiest;
  statistics_.critical_seconds += longest;
}

void VolumeElements::commit() {
  command(communicator_, Order::commit, {}, local_);
  histories_.commit();
}

std::vector<PointReport> VolumeElements::reports() {
  const std::vector<std::string> answers = command(communicator_, Order::report, {}, local_);
  std::vector<PointReport> reports;
  for (std::size_t rank = 0; rank < shares_.size(); ++rank) {
    PacketReader packet(answers[rank]);
    if (packet.get<std::size_t>() == 0) continue;
    reports.resize(size());
    for (const std::size_t point : shares_[rank])
      packet.get_doubles(reports[point].values.data(), reports[point].values.size());
  }
  return reports;
}

/// Rank 0 takes one state of each rank after each of its own: all work on their next one meanwhile. Who fails, a rank
/// or the taker, does so after every rank has come to its end.
void VolumeElements::save_each(const TakeState& take) {
  const auto& points = shares_;
  std::exception_ptr failure;
  const auto pass_on = [&](std::size_t rank, const std::string& state, std::span<const std::size_t> of_rank) {
    std::vector<std::size_t> of_all;
    for (const std::size_t p : of_rank) of_all.push_back(points[rank].at(p));
    try {
      if (!failure) take(state, of_all);
    } catch (...) {
      failure = std::current_exception();
    }
  };
  give_order(communicator_, Order::save, {});
  std::vector<std::string> answers(points.size());
  const auto take_one_of_each_rank = [&] {
    bool any = false;
    for (std::size_t rank = 1; rank < answers.size(); ++rank) {
      if (!answers[rank].empty()) continue;
      std::string message = receive(communicator_, static_cast<int>(rank));
      PacketReader packet(message);
      if (static_cast<Verdict>(packet.get<std::int32_t>()) == Verdict::more) {
        const std::vector<std::size_t> of_rank = get_indices(packet);
        pass_on(rank, packet.get_text(), of_rank);
        any = true;
      } else {
        answers[rank] = std::move(message);
      }
    }
    return any;
  };
  try {
    local_.save_each([&](const std::string& state, std::span<const std::size_t> of_rank) {
      pass_on(0, state, of_rank);
      take_one_of_each_rank();
    });
  } catch (...) {
    if (!failure) failure = std::current_exception();
  }
  while (take_one_of_each_rank()) {
  }
  if (failure) std::rethrow_exception(failure);
  answers.erase(answers.begin());
  outputs(answers, 1);
}

/// A round gives every rank one of the states of its points.
void VolumeElements::load_each(const StateSource& states) {
  require_states_of(size(), states);
  std::vector<std::vector<std::pair<int, std::vector<std::size_t>>>> shares;
  std::size_t rounds = 0;
  for (const auto& points : shares_) {
    StateSource of_rank;
    for (const std::size_t p : points) of_rank.number_of_point.push_back(states.number_of_point[p]);
    shares.push_back(of_rank.points_of_states());
    rounds = std::max(rounds, shares.back().size());
  }
  for (std::size_t round = 0; round < rounds; ++round) {
    std::vector<std::string> inputs;
    for (const auto& share : shares) {
      PacketWriter packet;
      put_indices(packet, round < share.size() ? share[round].second : std::vector<std::size_t>());
      if (round < share.size()) packet.put(states.read(share[round].first));
      inputs.push_back(packet.take());
    }
    command(communicator_, Order::load, inputs, local_);
  }
  const bool known = !states.history_of_point.empty();
  histories_ = EqualHistories(known ? states.history_of_point : states.number_of_point);
}

std::vector<int> VolumeElements::owners() const {
  std::vector<int> owner(size());
  for (std::size_t rank = 0; rank < shares_.size(); ++rank)
    for (const std::size_t point : shares_[rank]) owner[point] = static_cast<int>(rank);
  return owner;
}

Balance VolumeElements::balance(bool may_move) {
  const int ranks = size_of(communicator_);
  const std::vector<int> now = owners();
  const double steps = statistics_.dem_steps - at_last_balance_.dem_steps;
  const double of_step = std::accumulate(latest_.begin(), latest_.end(), 0.0) / std::max(steps, 1.0);
  const bool may = may_move && !shared();
  const std::vector<int> next = may ? rebalance(older_, latest_, now, ranks, of_step * kSceneMove) : now;
  const std::size_t moved = move_to(next);
  Balance balance{imbalance(loads(latest_, now, ranks)),
                  imbalance(loads(latest_, next, ranks)),
                  moved,
                  statistics_.move_seconds - at_last_balance_.move_seconds,
                  statistics_.efficiency(at_last_balance_, ranks),
                  statistics_.clock_efficiency(at_last_balance_, ranks),
                  statistics_.working_share(at_last_balance_, ranks * local_.threads())};
  if (moved > 0) statistics_.last_move = balance;
  balance.moved = static_cast<std::size_t>(statistics_.moved - at_last_balance_.moved);
  at_last_balance_ = statistics_;
  for (std::size_t p = 0; p < size(); ++p) older_[p] = shared() ? 0 : (older_[p] + latest_[p]) / 2;
  std::fill(latest_.begin(), latest_.end(), 0.0);
  return balance;
}

bool VolumeElements::shared() const {
  return static_cast<double>(distinct_) < kMostlyDistinct * static_cast<double>(size());
}

/// Before the first trial of a step, which is to F.
void VolumeElements::relieve_ranks(std::span<const Tensor2> F) {
  if (shares_.size() < 2 || shared() || statistics_.dem_steps == 0) return;
  const std::vector<std::string> answers = command(communicator_, Order::cost, gradients(F, shares_), local_);
  std::vector<double> costs(size());
  const auto trials = static_cast<double>(std::max(trials_of_last_step_, 1L));
  for (std::size_t rank = 0; rank < shares_.size(); ++rank) {
    PacketReader packet(answers[rank]);
    if (packet.get<std::size_t>() != shares_[rank].size()) return;
    for (const std::size_t point : shares_[rank]) costs[point] = trials * packet.get<double>();
  }
  const double of_step = statistics_.cost / statistics_.dem_steps * local_.threads();
  move_to(relieve(costs, owners(), static_cast<int>(shares_.size()), of_step * kCellMove));
}

/// Points go to these ranks, from the one that has them straight to the other; how many have moved.
std::size_t VolumeElements::move_to(const std::vector<int>& owner) {
  const std::vector<int> now = owners();
  std::vector<std::size_t> moves(shares_.size(), 0);
  std::vector<PacketWriter> packets(shares_.size());
  std::size_t moved = 0;
  for (std::size_t p = 0; p < size(); ++p) {
    if (owner[p] == now[p]) continue;
    const auto from = static_cast<std::size_t>(now[p]), to = static_cast<std::size_t>(owner[p]);
    const auto place = std::find(shares_[from].begin(), shares_[from].end(), p);
    packets[from].put(owner[p]);
    packets[from].put(true);
    packets[from].put(static_cast<std::size_t>(place - shares_[from].begin()));
    packets[to].put(now[p]);
    packets[to].put(false);
    ++moves[from];
    ++moves[to];
    shares_[from].erase(place);
    shares_[to].push_back(p);
    ++moved;
  }
  if (moved == 0) return 0;
  std::vector<std::string> inputs;
  for (std::size_t rank = 0; rank < shares_.size(); ++rank) {
    PacketWriter head;
    head.put(moves[rank]);
    inputs.push_back(head.take() + packets[rank].take());
  }
  const auto start = std::chrono::steady_clock::now();
  command(communicator_, Order::exchange, inputs, local_);
  statistics_.move_seconds += seconds_since(start);
  statistics_.moved += static_cast<long>(moved);
  return moved;
}

std::string describe(const Balance& balance, std::size_t points) {
  const std::string found = fmt::format(
      "balance of the ranks since the last checkpoint: {:.3f} of ideal by counted cost, {:.3f} by the clock, "
      "{:.3f} with all that evaluations take besides; {} moves of {} points in {:.2g} s",
      balance.counted, balance.clocked, balance.working, balance.moved, points, balance.seconds);
  if (balance.before == balance.after) return found;
  return found +
         fmt::format(", the busiest rank has {:.3f} instead of {:.3f} of the mean", balance.after, balance.before);
}

VolumeElements::Account VolumeElements::account() {
  Account sum;
  for (const std::string& output : command(communicator_, Order::account, {}, local_)) {
    PacketReader packet(output);
    sum.peak_memory += packet.get<std::uint64_t>();
    sum.check.trials += packet.get<long>();
    sum.check.equal += packet.get<long>();
  }
  return sum;
}

}  // namespace femxdem
