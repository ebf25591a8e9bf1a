#include <fmt/format.h>
#include <mpi.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <random>
#include <sstream>

#include "compact_volume_elements.hpp"
#include "python_volume_elements.hpp"
#include "rank_service.hpp"
#include "ve_templates.hpp"
#include "volume_elements.hpp"

/// What the bridge costs beside the DEM engine, on volume elements as they are used:
///
///     bridge_benchmark snapshot --spheres 1000                  fork against serialise, trials of one DEM step
///     bridge_benchmark trial --inertial-number 0.02 --steps 10  trials as a solver asks for them
///     mpirun -np 2 bridge_benchmark overhead --spheres 1000     engine seconds over ranks x wall time of evaluate
///     mpirun -np 2 bridge_benchmark moves --spheres 1000        a compact cell's way to another rank, in its DEM steps
namespace femxdem {
namespace {

struct Settings {
  int spheres = 1000;
  std::size_t points = 20;
  int steps = 100;
  int repetitions = 3;
  double inertial_number = 5e-3;
  double cohesion = 1;
  std::string cache = "packings";
};

std::string packing(PythonVolumeElements& elements, const Settings& settings) {
  VeParameters ve;
  ve.spheres = settings.spheres;
  ve.cohesion = settings.cohesion;
  ve.cache = settings.cache;
  return make_templates(elements, {ve}, [](std::string_view line) { fmt::print("{}\n", line); }).front();
}

VolumeElementOptions options(const Settings& settings, bool serialise = false) {
  VolumeElementOptions options;
  options.min_steps = settings.steps;
  options.inertial_number = settings.inertial_number;
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

/// Biaxial gradients reached in `steps` steps at the inertial number, from F = I; the path goes forth and back.
std::vector<Tensor2> biaxial(PythonVolumeElements& elements, const Settings& settings, int trial) {
  const VeInfo info = elements.info(0);
  const double way = 0.999 * settings.steps * info.time_step * settings.inertial_number / info.time_scale;
  const double from_start = way * (trial % 4 == 1 ? 2 : trial % 2 == 0 ? 1 : 0) / std::sqrt(1.25);
  Tensor2 F = Tensor2::Identity();
  F(0, 0) = std::exp(0.5 * from_start);
  F(1, 1) = std::exp(-from_start);
  return std::vector<Tensor2>(elements.size(), F);
}

struct ProcessorTime {
  double all = 0, kernel = 0;  ///< kernel: part of all
};

/// Processor time of a worker and of all that it has forked so far [s].
ProcessorTime processor_time(const WorkerProcess& worker) {
  std::ifstream file(fmt::format("/proc/{}/stat", worker.pid()));
  std::string line;
  std::getline(file, line);
  std::istringstream fields(line.substr(line.rfind(')') + 2));
  std::string skipped;
  for (int k = 3; k < 14; ++k) fields >> skipped;
  std::array<double, 4> ticks{};  // utime, stime, cutime, cstime of proc(5)
  for (double& value : ticks) fields >> value;
  rusage reaped{};
  getrusage(RUSAGE_CHILDREN, &reaped);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  const double tick = 1.0 / static_cast<double>(sysconf(_SC_CLK_TCK));
  const double kernel = (ticks[1] + ticks[3]) * tick + seconds(reaped.ru_stime);
  return {kernel + (ticks[0] + ticks[2]) * tick + seconds(reaped.ru_utime), kernel};
}

/// Waits until the last trial and the last former committed process are gone and counted.
void settle(PythonVolumeElements& elements) {
  elements.versions();
  usleep(300'000);
  elements.versions();
}

/// Processor time of one trial per volume element, snapshot included, and of its commit [ms].
ProcessorTime cost(WorkerProcess& worker, PythonVolumeElements& elements, const std::vector<Tensor2>& F, bool commit) {
  elements.begin_step();
  const ProcessorTime before = processor_time(worker);
  for (const Response& response : elements.evaluate(F, Operator::none))
    if (response.failure) throw std::runtime_error(response.failure->sentence);
  if (commit) elements.commit();
  settle(elements);
  const ProcessorTime after = processor_time(worker);
  const double each = 1e3 / static_cast<double>(elements.size());
  return {each * (after.all - before.all), each * (after.kernel - before.kernel)};
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Serialised and forked trials take turns, so that both see the same load of the machine. The DEM steps stay in the
/// numbers: subtracting trials measured apart would leave their noise. A fork copies its pages in its first step; its
/// own cost is what the kernel spends: fork, page faults, exit.
void print_snapshot_costs(WorkerProcess& worker, const Settings& settings) {
  PythonVolumeElements forked(worker, options(settings));
  WorkerProcess other({});
  PythonVolumeElements saved(other, options(settings, true));
  const std::string state = packing(forked, settings);
  forked.add(state, settings.points);
  saved.add(state, settings.points);
  fmt::print(
      "{} volume elements of {} spheres; processor time [ms] of a volume element and trial of {} DEM steps, "
      "medians of {}\n",
      settings.points, settings.spheres, settings.steps, settings.repetitions);
  for (const bool commit : {false, true}) {
    std::vector<double> forking, kernel, saving;
    for (int trial = 0; trial < settings.repetitions; ++trial) {
      const std::vector<Tensor2> F = gradients(settings.points, trial);
      const ProcessorTime fork = cost(worker, forked, F, commit);
      forking.push_back(fork.all);
      kernel.push_back(fork.kernel);
      saving.push_back(cost(other, saved, F, commit).all);
    }
    fmt::print("{:<10} by forking {:.2f}, {:.2f} of it in the kernel; by serialising {:.2f}: ratio {:.1f}\n",
               commit ? "committed" : "rejected", median(forking), median(kernel), median(saving),
               median(saving) / median(forking));
  }
}

/// Each trial is made twice: rejected, and again to be committed.
void print_trial_costs(WorkerProcess& worker, const Settings& settings) {
  PythonVolumeElements elements(worker, options(settings));
  elements.add(packing(elements, settings), settings.points);
  std::vector<double> rejected, committed, kernel;
  for (int trial = 0; trial < settings.repetitions; ++trial) {
    const std::vector<Tensor2> F = biaxial(elements, settings, trial);
    const ProcessorTime all = cost(worker, elements, F, false);
    rejected.push_back(all.all);
    kernel.push_back(all.kernel);
    committed.push_back(cost(worker, elements, F, true).all);
  }
  fmt::print(
      "{} volume elements of {} spheres, I = {:g}, {} DEM steps: processor time [ms] of a volume element and trial, "
      "medians of {}: {:.2f}, {:.2f} of it in the kernel; with its commit {:.2f}\n",
      settings.points, settings.spheres, settings.inertial_number, settings.steps, settings.repetitions,
      median(rejected), median(kernel), median(committed));
}

void print_overhead(LocalPoints& local, const std::string& state, const Settings& settings) {
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
  fmt::print("workers' memory {:.0f} MB\n", static_cast<double>(points.account().peak_memory) / 1e6);
}

/// Every fourth point has a long trial, in each step another fourth: ranks give and take before the first trial.
void print_moves(LocalPoints& local, const std::string& state, const Settings& settings) {
  VolumeElements points(MPI_COMM_WORLD, local, {state}, std::vector<int>(settings.points, 0));
  points.balance_each_step();
  std::mt19937 generator(1);
  std::vector<double> strain(settings.points, 0.0);
  for (int step = 0; step < settings.repetitions; ++step) {
    std::vector<Tensor2> F(settings.points, Tensor2::Identity());
    for (std::size_t p = 0; p < settings.points; ++p) {
      strain[p] += generator() % 4 == 0 ? 4e-3 : 1e-5 + 1e-9 * static_cast<double>(p);
      F[p](1, 1) -= strain[p];
    }
    points.begin_step();
    points.evaluate(F, Operator::none);
    points.commit();
  }
  const FarmStatistics& s = points.statistics();
  const double move = 1e3 * s.move_seconds / static_cast<double>(s.moved),
               of_step = 1e3 * s.engine_seconds / s.dem_steps;
  fmt::print("{} points of {} spheres, {} steps: {} moves, {:.3f} ms each; a DEM step {:.4f} ms: {:.1f} of them\n",
             settings.points, settings.spheres, settings.repetitions, s.moved, move, of_step, move / of_step);
}

/// What rank 0 does with its local points, while the others serve.
template <class Measure>
void on_ranks(WorkerProcess& worker, const Settings& settings, bool compact, Measure measure) {
  MPI_Init(nullptr, nullptr);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  PythonVolumeElements scenes(worker, options(settings));
  CompactVolumeElements cells(worker, options(settings), {});
  LocalPoints& local = compact ? static_cast<LocalPoints&>(cells) : scenes;
  if (rank > 0)
    serve(MPI_COMM_WORLD, local);
  else
    measure(local, packing(scenes, settings), settings);
  MPI_Finalize();
}

}  // namespace
}  // namespace femxdem

int main(int argc, char** argv) {
  using namespace femxdem;
  CLI::App app{"Costs of the bridge between the ranks and YADE"};
  Settings settings;
  CLI::App* snapshot = app.add_subcommand("snapshot", "fork against serialise");
  CLI::App* trial = app.add_subcommand("trial", "trials as a solver asks for them");
  CLI::App* overhead = app.add_subcommand("overhead", "engine seconds over ranks x wall time of evaluate");
  CLI::App* moves = app.add_subcommand("moves", "a compact cell's way from rank to rank");
  app.require_subcommand(1);
  for (CLI::App* command : {snapshot, trial, overhead, moves}) {
    command->add_option("--spheres", settings.spheres, "of a volume element");
    command->add_option("--points", settings.points, "volume elements in all");
    command->add_option("--steps", settings.steps, "of a trial");
    command->add_option("--repetitions", settings.repetitions, "trials");
    command->add_option("--cache", settings.cache, "folder of prepared packings");
  }
  trial->add_option("--inertial-number", settings.inertial_number, "of the trials");
  trial->add_option("--cohesion", settings.cohesion, "p* of the packing");
  snapshot->preparse_callback([&](std::size_t) { settings.steps = 1; });  // what is left beside the engine
  CLI11_PARSE(app, argc, argv);
  WorkerProcess worker({});
  if (snapshot->parsed())
    print_snapshot_costs(worker, settings);
  else if (trial->parsed())
    print_trial_costs(worker, settings);
  else
    on_ranks(worker, settings, moves->parsed(), moves->parsed() ? print_moves : print_overhead);
}
