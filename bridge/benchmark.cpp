#include <fmt/format.h>
#include <mpi.h>

#include <CLI/CLI.hpp>
#include <chrono>

#include "python_volume_elements.hpp"
#include "ve_templates.hpp"

/// What the bridge costs beside the DEM engine, on volume elements as they are used. Two tables:
///
///     bridge_benchmark snapshot --spheres 1000                  fork against serialise, a VE and trial
///     mpirun -np 2 bridge_benchmark overhead --spheres 1000     engine seconds over ranks x wall time of evaluate
namespace femxdem {
namespace {

struct Settings {
  int spheres = 1000;
  std::size_t points = 20;
  int steps = 100;
  int repetitions = 3;
  std::string cache = "packings";
};

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::string packing(PythonVolumeElements& elements, const Settings& settings) {
  VeParameters ve;
  ve.spheres = settings.spheres;
  ve.cache = settings.cache;
  return make_templates(elements, {ve}, [](std::string_view line) { fmt::print("{}\n", line); }).front();
}

VolumeElementOptions options(const Settings& settings, bool serialise = false) {
  VolumeElementOptions options;
  options.min_steps = settings.steps;
  options.serialise = serialise;
  options.max_unbalanced_force = 1e9;
  return options;
}

/// Gradients that every volume element reaches in the least number of steps; another one for each trial.
std::vector<Tensor2> gradients(std::size_t points, int trial) {
  Tensor2 F = Tensor2::Identity();
  F(1, 1) -= 1e-6 * (1 + trial);
  return std::vector<Tensor2>(points, F);
}

struct Cost {
  double wall = 0;    ///< of a trial and volume element [s]
  double inside = 0;  ///< of which in deform and measure [s]
};

/// Mean over the trials, each followed by a rejection or by a commit.
Cost trials(PythonVolumeElements& elements, const Settings& settings, bool commit) {
  Cost cost;
  elements.evaluate(gradients(elements.size(), 0), Operator::none);
  const auto start = std::chrono::steady_clock::now();
  for (int trial = 1; trial <= settings.repetitions; ++trial) {
    for (const Response& r : elements.evaluate(gradients(elements.size(), trial), Operator::none)) {
      if (r.failure) throw std::runtime_error(r.failure->sentence);
      cost.inside += r.report["seconds"];
    }
    if (commit) elements.commit();
  }
  elements.versions();  // waits until the last trial is gone
  const double trials = static_cast<double>(elements.size()) * settings.repetitions;
  return {seconds_since(start) / trials, cost.inside / trials};
}

void print_snapshot_costs(WorkerProcess& worker, const Settings& settings) {
  PythonVolumeElements forked(worker, options(settings));
  WorkerProcess other({});
  PythonVolumeElements saved(other, options(settings, true));
  const std::string state = packing(forked, settings);
  forked.add(state, settings.points);
  saved.add(state, settings.points);
  fmt::print("{} volume elements of {} spheres, {} steps a trial; ms a volume element and trial\n", settings.points,
             settings.spheres, settings.steps);
  fmt::print("{:<22}{:>12}{:>12}{:>12}{:>12}\n", "trial is", "wall, fork", "wall, saved", "fork costs", "saving costs");
  for (const bool commit : {false, true}) {
    const Cost by_saving = trials(saved, settings, commit);
    const Cost by_fork = trials(forked, settings, commit);
    // what the trial itself costs is what it costs where no pages are copied
    const double fork_cost = by_fork.wall - by_saving.inside, saving_cost = by_saving.wall - by_saving.inside;
    fmt::print("{:<22}{:>12.2f}{:>12.2f}{:>12.2f}{:>12.2f}   ratio {:.1f}\n", commit ? "committed" : "rejected",
               1e3 * by_fork.wall, 1e3 * by_saving.wall, 1e3 * fork_cost, 1e3 * saving_cost, saving_cost / fork_cost);
  }
}

void print_overhead(PythonVolumeElements& local, const Settings& settings) {
  const std::string state = packing(local, settings);
  VolumeElements points(MPI_COMM_WORLD, local, {state}, std::vector<int>(settings.points, 0));
  int ranks = 1;
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  for (int trial = 0; trial < settings.repetitions; ++trial) {
    points.evaluate(gradients(settings.points, trial), Operator::none);
    points.commit();
  }
  const FarmStatistics& s = points.statistics();
  fmt::print("{} points of {} spheres, {:.0f} steps a trial, {} ranks, {} trials\n", settings.points, settings.spheres,
             s.dem_steps / static_cast<double>(s.evaluations), ranks, s.batches);
  fmt::print("wall {:.2f} s; engine {:.2f} s, trials {:.2f} s, summed over the ranks\n", s.seconds, s.engine_seconds,
             s.trial_seconds);
  fmt::print("engine / (ranks x wall) = {:.3f}, trials / (ranks x wall) = {:.3f}; {:.0f} bytes a point and trial\n",
             s.engine_seconds / (ranks * s.seconds), s.trial_seconds / (ranks * s.seconds),
             static_cast<double>(s.bytes) / static_cast<double>(s.evaluations));
  fmt::print("workers' memory {:.0f} MB\n", static_cast<double>(points.peak_memory()) / 1e6);
}

void measure_overhead(WorkerProcess& worker, const Settings& settings) {
  MPI_Init(nullptr, nullptr);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  PythonVolumeElements local(worker, options(settings));
  if (rank > 0)
    serve(MPI_COMM_WORLD, local);
  else
    print_overhead(local, settings);
  MPI_Finalize();
}

}  // namespace
}  // namespace femxdem

int main(int argc, char** argv) {
  using namespace femxdem;
  CLI::App app{"Costs of the bridge between the ranks and YADE"};
  Settings settings;
  CLI::App* snapshot = app.add_subcommand("snapshot", "fork against serialise");
  CLI::App* overhead = app.add_subcommand("overhead", "engine seconds over ranks x wall time of evaluate");
  app.require_subcommand(1);
  for (CLI::App* command : {snapshot, overhead}) {
    command->add_option("--spheres", settings.spheres, "of a volume element");
    command->add_option("--points", settings.points, "volume elements in all");
    command->add_option("--steps", settings.steps, "of a trial");
    command->add_option("--repetitions", settings.repetitions, "trials");
    command->add_option("--cache", settings.cache, "folder of prepared packings");
  }
  CLI11_PARSE(app, argc, argv);
  WorkerProcess worker({});
  if (snapshot->parsed())
    print_snapshot_costs(worker, settings);
  else
    measure_overhead(worker, settings);
}
