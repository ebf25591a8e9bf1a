#include "rank_service.hpp"

#include <unistd.h>

#include <algorithm>
#include <exception>
#include <stdexcept>
#include <string_view>

#include "errors.hpp"

namespace femxdem {
namespace ranks {
namespace {

constexpr int kTag = 0;

/// Waits without taking the processor from the workers: a rank may wait for seconds, and there may be more ranks than
/// processors.
void wait(MPI_Request& request) {
  int arrived = 0;
  for (int spins = 0; MPI_Test(&request, &arrived, MPI_STATUS_IGNORE), !arrived; ++spins)
    if (spins > 1000) usleep(50);
}

/// Counts of MPI are ints: long texts go in pieces.
template <class Transfer>
void in_pieces(std::size_t size, Transfer transfer) {
  constexpr std::size_t piece = std::size_t{1} << 30;
  for (std::size_t done = 0; done < size; done += piece) {
    MPI_Request request = transfer(done, static_cast<int>(std::min(piece, size - done)));
    wait(request);
  }
}

void send(MPI_Comm communicator, int rank, const std::string& bytes) {
  const std::uint64_t size = bytes.size();
  MPI_Send(&size, 1, MPI_UINT64_T, rank, kTag, communicator);
  in_pieces(bytes.size(), [&](std::size_t start, int count) {
    MPI_Request request;
    MPI_Isend(bytes.data() + start, count, MPI_BYTE, rank, kTag, communicator, &request);
    return request;
  });
}

void put_response(PacketWriter& packet, const Response& response, bool with_stiffness) {
  packet.put_doubles(response.stress.data(), 9);
  if (with_stiffness) packet.put_doubles(response.stiffness.data(), 81);
  packet.put_doubles(response.report.values.data(), response.report.values.size());
  packet.put<bool>(response.failure.has_value());
  if (!response.failure) return;
  packet.put(response.failure->sentence);
  packet.put(response.failure->advice);
}

}  // namespace

std::string receive(MPI_Comm communicator, int rank) {
  std::uint64_t size = 0;
  MPI_Request announced;
  MPI_Irecv(&size, 1, MPI_UINT64_T, rank, kTag, communicator, &announced);
  wait(announced);
  std::string bytes(size, '\0');
  in_pieces(bytes.size(), [&](std::size_t start, int count) {
    MPI_Request request;
    MPI_Irecv(bytes.data() + start, count, MPI_BYTE, rank, kTag, communicator, &request);
    return request;
  });
  return bytes;
}

int size_of(MPI_Comm communicator) {
  int ranks = 1;
  MPI_Comm_size(communicator, &ranks);
  return ranks;
}

Response get_response(PacketReader& packet, bool with_stiffness, std::size_t point) {
  Response response;
  packet.get_doubles(response.stress.data(), 9);
  if (with_stiffness) packet.get_doubles(response.stiffness.data(), 81);
  packet.get_doubles(response.report.values.data(), response.report.values.size());
  if (packet.get<bool>()) {
    response.failure.emplace();
    response.failure->point = point;
    response.failure->sentence = packet.get_text();
    response.failure->advice = packet.get_text();
  }
  return response;
}

void put_indices(PacketWriter& packet, std::span<const std::size_t> indices) {
  packet.put(indices.size());
  for (const std::size_t index : indices) packet.put(index);
}

std::vector<std::size_t> get_indices(PacketReader& packet) {
  std::vector<std::size_t> indices(packet.get<std::size_t>());
  for (std::size_t& index : indices) index = packet.get<std::size_t>();
  return indices;
}

namespace {

/// Input: the templates, then that of each point.
void add(LocalPoints& local, PacketReader input) {
  std::vector<std::string> templates(input.get<std::size_t>());
  for (std::string& state : templates) state = input.get_text();
  const auto points = input.get<std::size_t>();
  std::size_t run = 0;
  int of_run = -1;
  const auto flush = [&] {
    if (run > 0) local.add(templates.at(static_cast<std::size_t>(of_run)), run);
  };
  for (std::size_t p = 0; p < points; ++p) {
    const int of_point = input.get<int>();
    if (of_point != of_run) {
      flush();
      run = 0;
    }
    of_run = of_point;
    ++run;
  }
  flush();
}

std::vector<Tensor2> gradients(const LocalPoints& local, PacketReader& input) {
  std::vector<Tensor2> F(local.size());
  for (Tensor2& gradient : F) input.get_doubles(gradient.data(), 9);
  return F;
}

/// Output: the number of costs, 0 or one for each local point, and the costs.
std::string cost(LocalPoints& local, PacketReader input) {
  const std::vector<double> costs = local.costs(gradients(local, input));
  PacketWriter output;
  output.put(costs.size());
  output.put_doubles(costs.data(), costs.size());
  return output.take();
}

std::string evaluate(LocalPoints& local, PacketReader input) {
  const auto wanted = static_cast<Operator>(input.get<int>());
  const std::vector<Tensor2> F = gradients(local, input);
  PacketWriter output;
  for (const Response& response : local.evaluate(F, wanted)) put_response(output, response, wanted != Operator::none);
  return output.take();
}

/// Output: the number of reports, 0 or one for each local point, and the reports.
std::string report(LocalPoints& local) {
  const std::vector<PointReport> reports = local.reports();
  PacketWriter output;
  output.put(reports.size());
  for (const PointReport& report : reports) output.put_doubles(report.values.data(), report.values.size());
  return output.take();
}

/// A message for each state: Verdict::more, its points, itself.
void hand_over(MPI_Comm communicator, LocalPoints& local) {
  local.save_each([&](const std::string& state, std::span<const std::size_t> points) {
    PacketWriter packet;
    packet.put(static_cast<std::int32_t>(Verdict::more));
    put_indices(packet, points);
    packet.put(state);
    send(communicator, 0, packet.take());
  });
}

void load(LocalPoints& local, PacketReader input) {
  const std::vector<std::size_t> points = get_indices(input);
  if (!points.empty()) local.load_into(points, input.get_text());
}

/// The answer of a rank: verdict, then the output or the text of the exception.
template <class Task>
std::string answer_of(Task task) {
  const auto packed = [](Verdict verdict, std::string_view text) {
    PacketWriter packet;
    packet.put(static_cast<std::int32_t>(verdict));
    packet.put(text);
    return packet.take();
  };
  try {
    return packed(Verdict::done, task());
  } catch (const UserError& error) {
    return packed(Verdict::user_error, error.what());
  } catch (const std::exception& error) {
    return packed(Verdict::error, error.what());
  }
}

/// States from rank to rank, one after another. Input: this rank's part of all moves, which keep their order on every
/// rank, so that none waits in a circle: the other rank, and the place of the point if it is given. A giver that fails
/// tells its taker; who fails does so after its last move.
void exchange(LocalPoints& local, PacketReader input, MPI_Comm communicator) {
  const auto moves = input.get<std::size_t>();
  std::exception_ptr failure;
  for (std::size_t move = 0; move < moves; ++move) {
    const int other = input.get<int>();
    if (input.get<bool>()) {
      const auto place = input.get<std::size_t>();
      send(communicator, other, answer_of([&] { return local.save_one(place); }));
      local.remove(place);
      continue;
    }
    const std::vector<std::string> received{receive(communicator, other)};
    try {
      local.add(outputs(received, static_cast<std::size_t>(other)).front(), 1);
    } catch (...) {
      if (!failure) failure = std::current_exception();
    }
  }
  if (failure) std::rethrow_exception(failure);
}

std::string carry_out(Order order, const std::string& input, LocalPoints& local, MPI_Comm communicator) {
  PacketWriter output;
  switch (order) {
    case Order::add:
      add(local, PacketReader(input));
      break;
    case Order::begin_step:
      local.begin_step();
      break;
    case Order::cost:
      return cost(local, PacketReader(input));
    case Order::evaluate:
      return evaluate(local, PacketReader(input));
    case Order::commit:
      local.commit();
      break;
    case Order::report:
      return report(local);
    case Order::save:
      hand_over(communicator, local);
      break;
    case Order::load:
      load(local, PacketReader(input));
      break;
    case Order::exchange:
      exchange(local, PacketReader(input), communicator);
      break;
    case Order::account: {
      const EngineCheck check = local.engine_check();
      output.put(local.peak_memory());
      output.put(check.trials);
      output.put(check.equal);
      break;
    }
    case Order::end:
      break;
  }
  return output.take();
}

std::string answer(Order order, const std::string& input, LocalPoints& local, MPI_Comm communicator) {
  return answer_of([&] { return carry_out(order, input, local, communicator); });
}

}  // namespace

std::vector<std::string> outputs(const std::vector<std::string>& answers, std::size_t first) {
  std::vector<std::string> texts;
  for (std::size_t rank = 0; rank < answers.size(); ++rank) {
    PacketReader packet(answers[rank]);
    const auto verdict = static_cast<Verdict>(packet.get<std::int32_t>());
    texts.push_back(packet.get_text());
    if (verdict == Verdict::user_error) throw UserError(texts.back());
    if (verdict == Verdict::error)
      throw std::runtime_error("rank " + std::to_string(first + rank) + ": " + texts.back());
  }
  return texts;
}

void give_order(MPI_Comm communicator, Order order, const std::vector<std::string>& inputs) {
  for (int rank = 1; rank < size_of(communicator); ++rank) {
    PacketWriter packet;
    packet.put(static_cast<std::int32_t>(order));
    packet.put(inputs.empty() ? std::string() : inputs[static_cast<std::size_t>(rank)]);
    send(communicator, rank, packet.take());
  }
}

std::vector<std::string> command(MPI_Comm communicator, Order order, const std::vector<std::string>& inputs,
                                 LocalPoints& local) {
  const int ranks = size_of(communicator);
  give_order(communicator, order, inputs);
  std::vector<std::string> answers{answer(order, inputs.empty() ? std::string() : inputs[0], local, communicator)};
  for (int rank = 1; rank < ranks; ++rank) answers.push_back(receive(communicator, rank));
  return outputs(answers);
}

}  // namespace ranks

void serve(MPI_Comm communicator, LocalPoints& local) {
  for (;;) {
    const std::string message = ranks::receive(communicator, 0);
    PacketReader packet(message);
    const auto order = static_cast<ranks::Order>(packet.get<std::int32_t>());
    ranks::send(communicator, 0, ranks::answer(order, packet.get_text(), local, communicator));
    if (order == ranks::Order::end) return;
  }
}

}  // namespace femxdem
