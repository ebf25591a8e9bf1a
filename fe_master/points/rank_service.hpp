#pragma once

#include <mpi.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "material_points.hpp"
#include "packet.hpp"

namespace femxdem {

/// Serves the local points of a rank other than 0 until rank 0 destroys its VolumeElements.
void serve(MPI_Comm communicator, LocalPoints& local);

/// What rank 0 says to the ranks about their points, and they to it: an order with its input, then a verdict with the
/// output or the text of an exception.
namespace ranks {

enum class Order : std::int32_t { add, begin_step, cost, evaluate, commit, report, save, load, exchange, account, end };
enum class Verdict : std::int32_t { done, user_error, error, more };

int size_of(MPI_Comm communicator);
/// The next message of that rank.
std::string receive(MPI_Comm communicator, int rank);

void put_indices(PacketWriter& packet, std::span<const std::size_t> indices);
std::vector<std::size_t> get_indices(PacketReader& packet);
/// What a rank has answered for this point.
Response get_response(PacketReader& packet, bool with_stiffness, std::size_t point);

/// An order to all ranks but 0, whose answers are still to be received; inputs: one a rank, or none.
void give_order(MPI_Comm communicator, Order order, const std::vector<std::string>& inputs);
/// Outputs of the ranks from `first` on; throws what the first of them that failed has to say.
std::vector<std::string> outputs(const std::vector<std::string>& answers, std::size_t first = 0);
/// One order to all ranks, each with its own input: their outputs. Rank 0 does its own share meanwhile.
std::vector<std::string> command(MPI_Comm communicator, Order order, const std::vector<std::string>& inputs,
                                 LocalPoints& local);

}  // namespace ranks
}  // namespace femxdem
