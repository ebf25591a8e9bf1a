#include <gtest/gtest.h>
#include <mpi.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>

#include "errors.hpp"
#include "rank_service.hpp"
#include "served_points.hpp"

namespace femxdem {
namespace {

constexpr int kNoMore = -1;

WorkerCommand dummy() {
  WorkerCommand command;
  command.engine = "dummy_engine:DummyEngine";
  command.python_path = TEST_ENGINES;
  return command;
}

std::unique_ptr<LocalPoints> make_local(Law law) {
  if (law == Law::path_length) return std::make_unique<PathLengthPoints>();
  return std::make_unique<PythonVolumeElements>(worker_of_this_rank(), VolumeElementOptions{});
}

int announce(int law) {
  MPI_Bcast(&law, 1, MPI_INT, 0, MPI_COMM_WORLD);
  return law;
}

}  // namespace

WorkerProcess& worker_of_this_rank() {
  static WorkerProcess worker(dummy());
  return worker;
}

WorkerProcess& worker_for_comparison() {
  static WorkerProcess worker(dummy());
  return worker;
}

Farm::Farm(Law law, const std::vector<std::string>& templates, const std::vector<int>& template_of_point) {
  announce(static_cast<int>(law));
  local = make_local(law);
  points = std::make_unique<VolumeElements>(MPI_COMM_WORLD, *local, templates, template_of_point);
}

Farm::~Farm() {
  points.reset();
  leave(*local);
}

void leave(LocalPoints& local) {
  while (local.size() > 0) local.remove(local.size() - 1);
}

PathLengthPoints::State PathLengthPoints::state_of(const std::string& bytes) {
  State state;
  if (bytes.size() != sizeof state) throw UserError("not a state of a path-length point");
  std::memcpy(&state, bytes.data(), sizeof state);
  return state;
}

void PathLengthPoints::add(const std::string& state, std::size_t count) {
  committed_.resize(size() + count, state_of(state));
}

std::string PathLengthPoints::at_rest(double modulus) {
  State state;
  state.modulus = modulus;
  return std::string(reinterpret_cast<const char*>(&state), sizeof state);
}

std::vector<Response> PathLengthPoints::evaluate(std::span<const Tensor2> F, Operator wanted) {
  std::vector<Response> responses;
  trial_ = committed_;
  for (std::size_t i = 0; i < size(); ++i) responses.push_back(respond(i, F[i], wanted));
  return responses;
}

Response PathLengthPoints::respond(std::size_t index, const Tensor2& F, Operator wanted) {
  Response response;
  if (F(2, 2) > 10) throw std::runtime_error("stretched beyond belief");
  if (!F.allFinite() || F.determinant() <= 0) {
    response.failure = Failure{index, "bad F", "Try a smaller load step."};
    return response;
  }
  State& state = trial_[index];
  const auto [R, U] = polar_decomposition(F);
  state.length += (U - Eigen::Map<const Tensor2>(state.U.data())).norm();
  Eigen::Map<Tensor2>(state.U.data()) = U;
  const Tensor2 I = Tensor2::Identity();
  response.stress = rotate(Tensor2(state.modulus * (U - I) + 0.1 * state.modulus * state.length * I), R);
  if (wanted == Operator::elastic) response.stiffness = rotate(isotropic_stiffness(0, state.modulus / 2), R);
  response.report["dem_steps"] = steps_of(state);
  return response;
}

std::vector<double> PathLengthPoints::costs(std::span<const Tensor2>) const {
  std::vector<double> costs;
  for (const State& state : committed_) costs.push_back(trial_cost(steps_of(state), 0));
  return costs;
}

std::string PathLengthPoints::save_one(std::size_t index) {
  if (committed_[index].length > 10) throw std::runtime_error("too long to be saved");
  return {reinterpret_cast<const char*>(&committed_[index]), sizeof(State)};
}

void PathLengthPoints::save_each(const TakeState& take) {
  for (std::size_t i = 0; i < size(); ++i) take(save_one(i), std::array{i});
}

void PathLengthPoints::load_into(std::span<const std::size_t> points, const std::string& state) {
  const State loaded = state_of(state);
  for (const std::size_t i : points) committed_.at(i) = loaded;
}

}  // namespace femxdem

int main(int argc, char** argv) {
  using namespace femxdem;
  worker_of_this_rank();
  if (const char* rank = std::getenv("OMPI_COMM_WORLD_RANK"); !rank || std::strcmp(rank, "0") == 0)
    worker_for_comparison();
  MPI_Init(&argc, &argv);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  int status = 0;
  if (rank == 0) {
    testing::InitGoogleTest(&argc, argv);
    status = RUN_ALL_TESTS();
    announce(kNoMore);
  } else {
    for (int law = announce(0); law != kNoMore; law = announce(0)) {
      const auto local = make_local(static_cast<Law>(law));
      serve(MPI_COMM_WORLD, *local);
      leave(*local);
    }
  }
  MPI_Finalize();
  return status;
}
