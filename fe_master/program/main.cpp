// femxdem: boundary value problems of granular materials, finite elements with volume elements of spheres.
#include <fcntl.h>
#include <mpi.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <optional>

#include "analytic_points.hpp"
#include "case.hpp"
#include "end_request.hpp"
#include "end_signals.hpp"
#include "engine_choice.hpp"
#include "errors.hpp"
#include "mesh.hpp"
#include "output_folder.hpp"
#include "rank_service.hpp"
#include "time_loop.hpp"
#include "tools.hpp"
#include "ve_commands.hpp"
#include "versions.hpp"
#include "volume_elements.hpp"

/// Of OpenBLAS, where that is the BLAS that SuiteSparse runs on.
extern "C" void openblas_set_num_threads(int) __attribute__((weak));

namespace femxdem {
namespace {

/// MPI for the life of the program; the worker must have been started before.
struct Mpi {
  Mpi() {
    MPI_Init(nullptr, nullptr);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &size);
    MPI_Comm machine;
    MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &machine);
    MPI_Comm_size(machine, &of_machine);
    MPI_Comm_free(&machine);
    if (rank > 0) ignore_end_signals();
  }
  ~Mpi() { MPI_Finalize(); }
  Mpi(const Mpi&) = delete;
  Mpi& operator=(const Mpi&) = delete;
  /// What rank 0 tells the others before the ranks work together: a number, or that it does not go on.
  void agree(std::optional<int> number) const {
    int told = number.value_or(-1);
    MPI_Bcast(&told, 1, MPI_INT, 0, MPI_COMM_WORLD);
  }
  std::optional<int> agreed() const {
    int told = -1;
    MPI_Bcast(&told, 1, MPI_INT, 0, MPI_COMM_WORLD);
    return told < 0 ? std::nullopt : std::optional(told);
  }
  int rank = 0, size = 1;
  int of_machine = 1;  ///< ranks that share this machine's processors
};

/// Opens what is closed of 0, 1 and 2, as batch systems leave it: else the next files would take their places.
void keep_standard_descriptors() {
  for (int descriptor = 0; descriptor < 3; ++descriptor)
    if (fcntl(descriptor, F_GETFD) < 0) open("/dev/null", O_RDWR);
}

/// True on the rank that speaks; known before MPI_Init from the environment of Open MPI or of Slurm's srun.
bool speaks() {
  for (const char* name : {"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"})
    if (const char* rank = std::getenv(name)) return std::string(rank) == "0";
  return true;
}

/// Trials that a run will ask of its volume elements, about: three evaluations a step.
double expected_trials(const Problem& problem) {
  const ControlParameters& control = problem.parameters().control;
  return 3 * control.end_time / control.max_step * static_cast<double>(problem.formulation().points());
}

int run_on_volume_elements(Problem& problem, RunOptions options) {
  const VeParameters& ve = problem.parameters().ve;
  WorkerProcess worker(worker_command(ve));
  const Mpi mpi;
  const auto local_points = [&](EngineKind engine) {
    return make_local_points(engine, worker, ve, expected_trials(problem), options.folder, mpi.of_machine);
  };
  if (mpi.rank > 0) {
    const auto engine = mpi.agreed();
    if (!engine) return kBadInput;
    serve(MPI_COMM_WORLD, *local_points(static_cast<EngineKind>(*engine)));
    return kDone;
  }
  const VePool pool = problem.volume_elements();
  PreparedRun prepared;
  try {
    options.lock = prepare_output_folder(options.folder, options.existing);
    prepared = prepare_run(worker, ve, pool.templates, options);
  } catch (...) {
    mpi.agree(std::nullopt);
    throw;
  }
  mpi.agree(static_cast<int>(prepared.engine));
  options.ranks = mpi.size;
  const auto local = local_points(prepared.engine);
  VolumeElements points(MPI_COMM_WORLD, *local, prepared.states, pool.template_of_point);
  const bool each_step = ve.balance && prepared.engine == EngineKind::compact;
  if (each_step) points.balance_each_step();
  if (mpi.size > 1)
    options.at_checkpoint = [&] { return describe(points.balance(ve.balance && !each_step), points.size()); };
  options.complete = [&](Summary& summary) {
    const VolumeElements::Account account = points.account();
    const FarmStatistics& statistics = points.statistics();
    summary.evaluate_seconds = statistics.seconds;
    summary.trial_seconds = statistics.trial_seconds;
    summary.engine_seconds = statistics.engine_seconds;
    summary.balance = statistics.efficiency({}, mpi.size);
    summary.imbalance_before = statistics.last_move.before;
    summary.imbalance_after = statistics.last_move.after;
    summary.moved = statistics.moved;
    summary.peak_memory_points = account.peak_memory;
    summary.threads = local->threads();
    summary.engine = name_of(prepared.engine);
    summary.engine_check = describe(account.check);
  };
  return run_case(problem, points, options);
}

int run(const Arguments& arguments) {
  const Case c = read_case(arguments.file, arguments.overrides);
  Problem problem(c);
  const RunOptions options = run_options(arguments, c);
  if (problem.on_volume_elements()) return run_on_volume_elements(problem, options);
  const Mpi mpi;
  if (mpi.rank > 0) return kDone;  // laws in closed form cost nothing: rank 0 alone
  AnalyticPoints points(problem.laws());
  return run_case(problem, points, options);
}

int check(const Arguments& arguments) {
  const Case c = read_case(arguments.file, arguments.overrides);
  const Mesh mesh = make_mesh(c.mesh, c.regions);
  std::cout << (arguments.effective ? "# " : "") << c.file << ": no mistakes; " << mesh.elements.size() << " elements, "
            << kPointsPerElement * mesh.elements.size() << " material points\n";
  if (arguments.effective) std::cout << effective_toml(c);
  return kDone;
}

int parameters(const Arguments& arguments) {
  std::cout << (arguments.markdown ? parameters_markdown() : describe_parameters());
  return kDone;
}

struct CommandLine {
  CLI::App app{"femxdem: finite elements whose material is a volume element of spheres in YADE"};
  Arguments arguments;
  int status = kDone;
};

using Command = int(const Arguments&);

/// A command that runs once the whole line is understood.
CLI::App* add_command(CommandLine& line, CLI::App& parent, const char* name, const char* text, Command* command) {
  CLI::App* added = parent.add_subcommand(name, text);
  added->callback([&line, command] { line.status = command(line.arguments); });
  return added;
}

CLI::App* add_case_command(CommandLine& line, CLI::App& parent, const char* name, const char* text, Command* command) {
  CLI::App* added = add_command(line, parent, name, text, command);
  added->add_option("case", line.arguments.file, "Case file (TOML)")->required();
  added->add_option("--set", line.arguments.overrides, "Override a parameter: section.key=value (repeatable)");
  return added;
}

void add_progress(CLI::App& command, Arguments& arguments) {
  command.add_flag_callback(
      "--progress", [&arguments] { arguments.progress = true; },
      "One line that updates (default on terminals, but not under mpirun or a scheduler)");
  command.add_flag_callback(
      "--no-progress", [&arguments] { arguments.progress = false; }, "A line for each step");
}

void add_restart(CLI::App& command, Arguments& arguments) {
  command.add_flag("--restart", arguments.restart, "Go on from the last checkpoint in that folder");
  command.add_option("--time-limit", arguments.time_limit,
                     "Save and end with status 75 before so much time is over: seconds, MM:SS, HH:MM:SS or "
                     "D-HH:MM:SS (default: the end of the Slurm job)");
}

void add_commands(CommandLine& line) {
  line.app.require_subcommand(0, 1);
  line.app.add_flag_callback(
      "--version",
      [] {
        std::cout << describe_versions();
        std::exit(kDone);
      },
      "Versions of the program and of what it uses, and what is missing");
  Arguments& arguments = line.arguments;
  CLI::App* run_it = add_case_command(line, line.app, "run", "Run a case; also under mpirun -n P", run);
  run_it->add_option("--out", arguments.folder, "Folder of the results (default: out/NAME)");
  add_restart(*run_it, arguments);
  run_it->add_flag("--overwrite", arguments.overwrite, "Replace results that are already there");
  add_progress(*run_it, arguments);
  add_case_command(line, line.app, "check", "Say all mistakes of a case file, without running it", check)
      ->add_flag("--effective", arguments.effective, "And the case as it would run, every default written out");
  add_command(line, line.app, "parameters", "Every parameter: unit, default, bounds, text", parameters)
      ->add_flag("--markdown", arguments.markdown, "As Markdown: fe_master/program/parameters.md");
}

void add_ve_commands(CommandLine& line) {
  Arguments& arguments = line.arguments;
  CLI::App& ve = *line.app.add_subcommand("ve", "A volume element by itself: path, prepare, inspect, serve");
  ve.require_subcommand(1);
  CLI::App* path = add_case_command(line, ve, "path", "Follow the [[path]] of a case with one material point", ve_path);
  path->add_option("--out", arguments.folder, "Folder of the results (default: out/NAME_ve)");
  add_restart(*path, arguments);
  path->add_flag("--overwrite", arguments.overwrite, "Replace results that are already there");
  add_progress(*path, arguments);
  path->add_option("--noise", arguments.noise_samples, "Probe the stress's jitter in each step with so many strains")
      ->check(CLI::Range(3, 1000));
  CLI::App* prepare = add_case_command(line, ve, "prepare", "Make the volume elements of a case", ve_prepare);
  prepare->add_option("--out", arguments.folder, "Folder of the packings (default: ve.cache, else packings)");
  prepare
      ->add_option(
          "--compare", arguments.compare,
          "Make them anew, each beside so many DEM steps of the scene's own continuation in YADE; the manifest and "
          "the notes tell the difference")
      ->check(CLI::Range(1, 1000000));
  add_case_command(line, ve, "inspect", "Draw a volume element: of a case, or a prepared .state", ve_inspect)
      ->add_option("--out", arguments.folder, "Folder of the figures (default: out/NAME_ve)");
  add_case_command(line, ve, "serve",
                   "Answer one strain a line of the standard input, for scripts: femxdem.py (the module femxdem)",
                   ve_serve);
}

}  // namespace
}  // namespace femxdem

int main(int argc, char** argv) {
  using namespace femxdem;
  keep_standard_descriptors();
  std::signal(SIGXFSZ, SIG_IGN);                                         // a limit on files' sizes is an error of write
  if (openblas_set_num_threads != nullptr) openblas_set_num_threads(1);  // the ranks are the parallelism
  CommandLine line;
  speaks() ? end_at_signals() : ignore_end_signals();
  for (int i = 0; i < argc; ++i) line.arguments.command_line += (i > 0 ? " " : "") + std::string(argv[i]);
  add_commands(line);
  add_ve_commands(line);
  for (const Tool& tool : tools()) line.app.add_subcommand(std::string(tool.name), std::string(tool.help));
  try {
    if (const Tool* tool = argc > 1 ? find_tool(argv[1]) : nullptr) become(*tool, {argv + 2, argv + argc});
    line.app.parse(argc, argv);
    if (line.app.get_subcommands().empty()) std::cout << line.app.help();
    return line.status;
  } catch (const CLI::ParseError& error) {
    return line.app.exit(error) == 0 ? kDone : kBadInput;
  } catch (const UserError& error) {
    if (speaks()) std::cerr << error.what() << "\n";
    return kBadInput;
  } catch (const DiskError& error) {
    std::cerr << error.what() << "\n";
    return kNotWritten;
  } catch (const std::bad_alloc&) {
    std::cerr << "femxdem: the system gives no more memory; use fewer ranks on this machine, or raise its limit "
                 "(ulimit -v), and "
                 "--restart from the last checkpoint\n";
    return kPointFailed;
  } catch (const std::exception& error) {
    std::cerr << "femxdem: " << error.what() << "\n";
    return kPointFailed;
  }
}
