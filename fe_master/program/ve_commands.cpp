#include "ve_commands.hpp"

#include <fmt/format.h>

#include <fstream>
#include <iostream>

#include "end_request.hpp"
#include "engine_choice.hpp"
#include "errors.hpp"
#include "locations.hpp"
#include "mesh.hpp"
#include "output_folder.hpp"
#include "path.hpp"
#include "tools.hpp"
#include "ve_service.hpp"
#include "ve_templates.hpp"
#include "versions.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

constexpr double kServedTrials = 100;  // for how many of them YADE repeats

void say(std::string_view line) { std::cout << line << std::endl; }

void refuse_ranks() {
  const char* size = std::getenv("OMPI_COMM_WORLD_SIZE");
  if (size != nullptr && std::string(size) != "1")
    throw UserError("femxdem ve works on one volume element: start it without mpirun");
}

void refuse_closed_form(const Case& c) {
  if (!on_volume_elements(c))
    throw UserError(fmt::format(
        "{}: its material is a law in closed form; set material.type = \"volume_element\" to have one", c.file));
}

/// The volume element of a case without its mesh: the base, in its first seed.
VeParameters single_ve(const Case& c) {
  VeParameters ve = c.ve;
  if (!ve.seeds.empty()) ve.seed = ve.seeds.front();
  return ve;
}

/// Trials that a path will ask of its volume element, about.
double expected_trials(const Case& c) {
  double increments = 0;
  for (const PathSegment& segment : c.path) increments += segment.increments;
  return 3 * increments;
}

/// Makes the volume element of a case and calls `use` with it; what its making says and decides goes into the options.
template <class Use>
int with_volume_element(const Case& c, RunOptions& options, double trials, Use use) {
  WorkerProcess worker(worker_command(c.ve));
  const PreparedRun prepared = prepare_run(worker, c.ve, {single_ve(c)}, options);
  const auto point = make_local_points(prepared.engine, worker, c.ve, trials, options.folder, 1);
  options.complete = [&](Summary& summary) {
    summary.peak_memory_points = point->peak_memory();
    summary.threads = point->threads();
    summary.engine = name_of(prepared.engine);
    summary.engine_check = describe(point->engine_check());
  };
  point->add(prepared.states.front(), 1);
  return use(*point);
}

int path_of_volume_element(const Case& c, RunOptions options, int noise_samples) {
  options.lock = prepare_output_folder(options.folder, options.existing);
  return with_volume_element(c, options, expected_trials(c),
                             [&](LocalPoints& point) { return follow_path(c, point, options, noise_samples); });
}

/// All volume elements of a case: those of its mesh, or of its seeds where it has none.
std::vector<VeParameters> pool_of(const Arguments& arguments) {
  const Case c = read_path_case(arguments.file, arguments.overrides);
  refuse_closed_form(c);
  if (!c.loads.empty()) {
    const Case problem = read_case(arguments.file, arguments.overrides);
    return ve_pool(problem, make_mesh(problem.mesh, problem.regions)).templates;
  }
  if (c.ve.seeds.empty()) return {c.ve};
  std::vector<VeParameters> pool;
  for (const int seed : c.ve.seeds) {
    pool.push_back(c.ve);
    pool.back().seed = seed;
  }
  return pool;
}

/// By when this process must have ended: --time-limit, counted from its start, or the end of the scheduler's job.
std::optional<Moment> ends_before(const Arguments& arguments) {
  if (arguments.time_limit.empty()) return end_of_job();
  const std::chrono::duration<double> limit(seconds_of(arguments.time_limit));
  return arguments.start + std::chrono::duration_cast<Moment::duration>(limit);
}

}  // namespace

RunOptions run_options(const Arguments& arguments, const Case& c, const char* ending) {
  RunOptions options;
  options.folder = arguments.folder;
  if (options.folder.empty()) {
    options.folder = c.output.directory;
    if (options.folder.empty()) options.folder = fs::path("out") / fs::path(c.file).stem();
    options.folder += ending;
  }
  options.existing = arguments.restart     ? Existing::resume
                     : arguments.overwrite ? Existing::overwrite
                                           : Existing::refuse;
  options.command_line = arguments.command_line;
  options.progress = arguments.progress;
  options.versions = library_versions();
  options.ends_before = ends_before(arguments);
  return options;
}

int ve_path(const Arguments& arguments) {
  refuse_ranks();
  const Case c = read_path_case(arguments.file, arguments.overrides);
  const RunOptions options = run_options(arguments, c, "_ve");
  if (on_volume_elements(c)) return path_of_volume_element(c, options, arguments.noise_samples);
  return follow_path(c, *make_analytic_point(c), options, arguments.noise_samples);
}

int ve_prepare(const Arguments& arguments) {
  refuse_ranks();
  std::vector<VeParameters> pool = pool_of(arguments);
  if (!arguments.folder.empty())
    for (VeParameters& ve : pool) ve.cache = arguments.folder;
  WorkerProcess worker({});
  PythonVolumeElements elements(worker, ve_options(pool.front()));
  make_templates(elements, pool, say, arguments.compare);
  for (const VeParameters& ve : pool)
    std::cout << std::ifstream(template_files(elements, ve).manifest).rdbuf() << std::endl;
  return kDone;
}

int ve_serve(const Arguments& arguments) {
  refuse_ranks();
  const Case c = read_path_case(arguments.file, arguments.overrides);
  refuse_closed_form(c);
  RunOptions options = run_options(arguments, c);
  options.folder = fs::temp_directory_path();  // for packings where nothing else can be written
  return with_volume_element(c, options, kServedTrials, [&](LocalPoints& point) {
    serve_volume_element(point, std::cin, std::cout);
    return kDone;
  });
}

int ve_inspect(const Arguments& arguments) {
  refuse_ranks();
  fs::path state = arguments.file, folder = arguments.folder;
  if (state.extension() == ".toml") {
    const Case c = read_path_case(arguments.file, arguments.overrides);
    refuse_closed_form(c);
    folder = run_options(arguments, c, "_ve").folder;
    WorkerProcess worker({});
    PythonVolumeElements elements(worker, ve_options(c.ve));
    VeParameters ve = single_ve(c);
    ve.cache = writable_cache(ve, folder);
    make_templates(elements, {ve}, say);
    state = template_files(elements, ve).state;
  }
  if (!fs::is_regular_file(state)) throw UserError(fmt::format("{}: no such file; correct the path", state.string()));
  if (state.extension() != ".state")
    throw UserError(
        fmt::format("{}: neither a case (.toml) nor a prepared volume element (.state); for a script or a scene, "
                    "give the case that names it",
                    state.string()));
  if (folder.empty()) folder = "out" / state.stem();
  become_python(locations().yade_scripts / "inspect_ve.py", {state.string(), "--out", folder.string()});
}

}  // namespace femxdem
