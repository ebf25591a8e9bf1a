// femxdem: boundary value problems of granular materials, finite elements with volume elements of spheres.
#include <fcntl.h>
#include <mpi.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include "analytic_points.hpp"
#include "case.hpp"
#include "engine_choice.hpp"
#include "errors.hpp"
#include "mesh.hpp"
#include "output_folder.hpp"
#include "time_loop.hpp"
#include "tools.hpp"
#include "ve_commands.hpp"
#include "ve_templates.hpp"
#include "versions.hpp"
#include "volume_elements.hpp"

/// Of OpenBLAS, where that is the BLAS that SuiteSparse runs on.
extern "C" void openblas_set_num_threads(int) __attribute__((weak));

namespace femxdem {
namespace {

struct Arguments {
  std::string case_file;
  std::string folder;
  std::vector<std::string> overrides;
  bool restart = false;
  bool overwrite = false;
  std::optional<bool> progress;
  int noise_samples = 0;
  int compare = 0;
  bool markdown = false;
  std::string command_line;
};

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

/// True on the rank that speaks; known before MPI_Init from Open MPI's environment.
bool speaks() {
  const char* rank = std::getenv("OMPI_COMM_WORLD_RANK");
  return rank == nullptr || std::string(rank) == "0";
}

RunOptions run_options(const Arguments& arguments) {
  RunOptions options;
  options.folder = arguments.folder;
  options.existing = arguments.restart     ? Existing::resume
                     : arguments.overwrite ? Existing::overwrite
                                           : Existing::refuse;
  options.command_line = arguments.command_line;
  options.progress = arguments.progress;
  options.versions = library_versions();
  return options;
}

RunOptions run_options(const Case& c, const Arguments& arguments) {
  RunOptions options = run_options(arguments);
  if (options.folder.empty()) options.folder = c.output.directory;
  if (options.folder.empty()) options.folder = std::filesystem::path("out") / std::filesystem::path(c.file).stem();
  return options;
}

VeArguments ve_arguments(const Arguments& arguments) {
  return {arguments.case_file, arguments.overrides, run_options(arguments), arguments.compare, arguments.noise_samples};
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
  Problem::Start start = problem.volume_elements();
  std::vector<std::string> templates;
  EngineVerdict verdict;
  try {
    options.lock = prepare_output_folder(options.folder, options.existing);
    for (VeParameters& setup : start.templates) setup.cache = writable_cache(setup, options.folder);
    PythonVolumeElements maker(worker, ve_options(ve));
    templates = make_templates(maker, start.templates, [&](std::string_view line) {
      std::cout << line << std::endl;
      options.remarks.emplace_back(line);
    });
    options.versions.merge(engine_versions(maker));
    verdict = choose_engine(ve.engine, worker, templates);
  } catch (...) {
    mpi.agree(std::nullopt);
    throw;
  }
  mpi.agree(static_cast<int>(verdict.engine));
  options.ranks = mpi.size;
  options.remarks.push_back(verdict.sentence);
  const auto local = local_points(verdict.engine);
  VolumeElements points(MPI_COMM_WORLD, *local, templates, start.template_of_point);
  if (mpi.size > 1) options.at_checkpoint = [&] { return describe(points.balance(ve.balance), points.size()); };
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
    summary.peak_memory_workers = account.peak_memory;
    summary.threads = local->threads();
    summary.engine = name_of(verdict.engine);
    summary.engine_check = describe(account.check);
  };
  return run_case(problem, points, options);
}

int run(const Arguments& arguments) {
  const Case c = read_case(arguments.case_file, arguments.overrides);
  Problem problem(c);
  const RunOptions options = run_options(c, arguments);
  if (problem.on_volume_elements()) return run_on_volume_elements(problem, options);
  const Mpi mpi;
  if (mpi.rank > 0) return kDone;  // laws in closed form cost nothing: rank 0 alone
  AnalyticPoints points(problem.laws());
  return run_case(problem, points, options);
}

int check(const Arguments& arguments) {
  const Case c = read_case(arguments.case_file, arguments.overrides);
  const Mesh mesh = make_mesh(c.mesh, c.regions);
  std::cout << c.file << ": no mistakes; " << mesh.elements.size() << " elements, "
            << kPointsPerElement * mesh.elements.size() << " material points\n";
  return kDone;
}

}  // namespace
}  // namespace femxdem

int main(int argc, char** argv) {
  using namespace femxdem;
  keep_standard_descriptors();
  std::signal(SIGXFSZ, SIG_IGN);                                         // a limit on files' sizes is an error of write
  if (openblas_set_num_threads != nullptr) openblas_set_num_threads(1);  // the ranks are the parallelism
  Arguments arguments;
  for (int i = 0; i < argc; ++i) arguments.command_line += (i > 0 ? " " : "") + std::string(argv[i]);

  CLI::App app("femxdem: finite elements whose material is a volume element of spheres in YADE");
  app.require_subcommand(0, 1);
  app.add_flag_callback(
      "--version",
      [] {
        std::cout << describe_versions();
        std::exit(kDone);
      },
      "Versions of the program and of what it uses, and what is missing");
  const auto add_case = [&](CLI::App* command) {
    command->add_option("case", arguments.case_file, "Case file (TOML)")->required();
    command->add_option("--set", arguments.overrides, "Override a parameter: section.key=value (repeatable)");
  };
  const auto add_progress = [&](CLI::App* command) {
    command->add_flag_callback(
        "--progress", [&] { arguments.progress = true; },
        "One line that updates (default on terminals, but not under mpirun or a scheduler)");
    command->add_flag_callback(
        "--no-progress", [&] { arguments.progress = false; }, "A line for each step");
  };
  CLI::App* run_command = app.add_subcommand("run", "Run a case; also under mpirun -n P");
  add_case(run_command);
  run_command->add_option("--out", arguments.folder, "Folder of the results (default: out/NAME)");
  run_command->add_flag("--restart", arguments.restart, "Go on from the last checkpoint in that folder");
  run_command->add_flag("--overwrite", arguments.overwrite, "Replace results that are already there");
  add_progress(run_command);
  CLI::App* check_command = app.add_subcommand("check", "Say all mistakes of a case file, without running it");
  add_case(check_command);
  CLI::App* parameters_command = app.add_subcommand("parameters", "Every parameter: unit, default, bounds, text");
  parameters_command->add_flag("--markdown", arguments.markdown, "As Markdown: fe_master/program/parameters.md");

  CLI::App* ve_command = app.add_subcommand("ve", "A volume element by itself: path, prepare, inspect, serve");
  ve_command->require_subcommand(1);
  CLI::App* path_command = ve_command->add_subcommand("path", "Follow the [[path]] of a case with one material point");
  add_case(path_command);
  path_command->add_option("--out", arguments.folder, "Folder of the results (default: out/NAME_ve)");
  path_command->add_flag("--overwrite", arguments.overwrite, "Replace results that are already there");
  add_progress(path_command);
  path_command
      ->add_option("--noise", arguments.noise_samples, "Probe the stress's jitter in each step with so many strains")
      ->check(CLI::Range(3, 1000));
  CLI::App* prepare_command = ve_command->add_subcommand("prepare", "Make the volume elements of a case");
  add_case(prepare_command);
  prepare_command->add_option("--out", arguments.folder, "Folder of the packings (default: ve.cache, else packings)");
  prepare_command
      ->add_option(
          "--compare", arguments.compare,
          "Make them anew, each beside so many DEM steps of the scene's own continuation in YADE; the manifest and "
          "the notes tell the difference")
      ->check(CLI::Range(1, 1000000));
  CLI::App* inspect_command =
      ve_command->add_subcommand("inspect", "Draw a volume element: of a case, or a prepared .state");
  add_case(inspect_command);
  inspect_command->add_option("--out", arguments.folder, "Folder of the figures (default: out/NAME_ve)");
  CLI::App* serve_command = ve_command->add_subcommand(
      "serve", "Answer one strain a line of the standard input, for scripts: femxdem.py (the module femxdem)");
  add_case(serve_command);
  for (const Tool& tool : tools()) app.add_subcommand(std::string(tool.name), std::string(tool.help));

  try {
    if (const Tool* tool = argc > 1 ? find_tool(argv[1]) : nullptr) become(*tool, {argv + 2, argv + argc});
    app.parse(argc, argv);
    if (*run_command) return run(arguments);
    if (*check_command) return check(arguments);
    if (*path_command) return ve_path(ve_arguments(arguments));
    if (*prepare_command) return ve_prepare(ve_arguments(arguments));
    if (*serve_command) return ve_serve(ve_arguments(arguments));
    if (*inspect_command) return ve_inspect(ve_arguments(arguments));
    if (*parameters_command) std::cout << (arguments.markdown ? parameters_markdown() : describe_parameters());
    if (app.get_subcommands().empty()) std::cout << app.help();
    return kDone;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kBadInput;
  } catch (const UserError& error) {
    if (speaks()) std::cerr << error.what() << "\n";
    return kBadInput;
  } catch (const DiskError& error) {
    std::cerr << error.what() << "\n";
    return kNotWritten;
  } catch (const std::exception& error) {
    std::cerr << "femxdem: " << error.what() << "\n";
    return kPointFailed;
  }
}
