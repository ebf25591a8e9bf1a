#pragma once

#include <memory>

#include "python_volume_elements.hpp"
#include "volume_elements.hpp"

/// Points with a history, in closed form, that complain on demand.
namespace femxdem {

/// Elastic cell whose stress also depends on the length of its path: sigma = R (E (U - I) + H s I) R^T, s the sum of
/// |U - U_n|. A trial counts 7 DEM steps, or more with more than 1e8 Pa in proportion. A gradient with F_22 above 10
/// throws on the rank that holds the point, as does saving one whose path is longer than 10.
class PathLengthPoints : public LocalPoints {
 public:
  void add(const std::string& state, std::size_t count) override;
  void remove(std::size_t index) override { committed_.erase(committed_.begin() + static_cast<std::ptrdiff_t>(index)); }
  std::string save_one(std::size_t index) override;
  std::uint64_t peak_memory() const override { return 1000 + size(); }
  std::size_t size() const override { return committed_.size(); }
  std::vector<double> costs(std::span<const Tensor2> F) const override;
  std::vector<Response> evaluate(std::span<const Tensor2> F, Operator wanted) override;
  void commit() override { committed_ = trial_; }
  void save_each(const TakeState& take) override;
  void load_into(std::span<const std::size_t> points, const std::string& state) override;

  /// State at rest with modulus E [Pa].
  static std::string at_rest(double modulus);

 private:
  struct State {
    double modulus = 0;
    double length = 0;
    std::array<double, 9> U{1, 0, 0, 0, 1, 0, 0, 0, 1};
  };
  static State state_of(const std::string& bytes);
  static double steps_of(const State& state) { return 7 * std::max(1.0, state.modulus / 1e8); }
  Response respond(std::size_t index, const Tensor2& F, Operator wanted);

  std::vector<State> committed_;
  std::vector<State> trial_;
};

/// What a rank serves in the next test.
enum class Law : int { path_length, dummy_engine };

/// The farm on rank 0: tells the other ranks which law to serve and constructs the points on all of them.
struct Farm {
  Farm(Law law, const std::vector<std::string>& templates, const std::vector<int>& template_of_point);
  ~Farm();
  std::unique_ptr<LocalPoints> local;
  std::unique_ptr<VolumeElements> points;
};

/// Removes all points: a worker is empty when the next test adds its own.
void leave(LocalPoints& local);

/// The worker of this rank, started before MPI_Init.
WorkerProcess& worker_of_this_rank();
/// A second one on rank 0, for comparison.
WorkerProcess& worker_for_comparison();

}  // namespace femxdem
