#include "engine_choice.hpp"

#include <fmt/format.h>
#include <sched.h>

#include <iostream>
#include <thread>

#include "compact_volume_elements.hpp"
#include "errors.hpp"
#include "hash.hpp"
#include "python_volume_elements.hpp"
#include "ve_templates.hpp"

namespace femxdem {
namespace {

constexpr long kSteps = 20;           // in which every template is compared at the start
constexpr double kChecksOfARun = 20;  // where the case does not say how many

/// Why compact cells may not stand for this template; nothing where they may.
std::optional<std::string> objection(Referee& referee, const std::string& state) {
  const ExportedScene exported = referee.exported(state);
  if (!exported.covered) return "they do not cover it: " + exported.bytes;
  referee.add_origin(hash(state), state);
  const CompactCell cell = CompactCell::from_scene(exported.bytes);
  Straining straining;
  straining.steps = kSteps;
  const double rate = 1e-2 / cell.info().time_scale;  // a general stretch at an inertial number of about 1e-2
  straining.velocity_gradient = {0.3 * rate, 0.1 * rate, 0, 0.1 * rate, -rate, 0.2 * rate, 0, 0.2 * rate, 0.2 * rate};
  CompactCell strained = cell;
  if (const auto end = strained.deform(straining.velocity_gradient, straining.steps); end.failure) return *end.failure;
  return referee.difference(hash(state), cell, straining, strained);
}

/// Processors that this process may use, shared with the other ranks of the machine unless it has its own.
int processors(int ranks) {
  cpu_set_t set;
  CPU_ZERO(&set);
  const int mine = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
  const int all = static_cast<int>(std::thread::hardware_concurrency());
  return std::max(1, mine < all ? mine : all / ranks);
}

}  // namespace

EngineVerdict choose_engine(EngineChoice asked, WorkerProcess& worker, const std::vector<std::string>& states) {
  if (asked == EngineChoice::yade) return {EngineKind::yade, "engine: YADE, as the case asks (ve.engine)"};
  Referee referee(worker);
  for (std::size_t t = 0; t < states.size(); ++t) {
    const auto why_not = objection(referee, states[t]);
    if (!why_not) continue;
    const std::string sentence =
        fmt::format("volume element {} of {} cannot be a compact cell: {}", t + 1, states.size(), *why_not);
    if (asked == EngineChoice::compact) throw UserError(sentence + "; set ve.engine = \"auto\" or \"yade\"");
    return {EngineKind::yade, "engine: YADE; " + sentence};
  }
  return {EngineKind::compact,
          fmt::format("engine: compact cells; every template equals YADE's to the bit over {} steps", kSteps)};
}

PreparedRun prepare_run(WorkerProcess& worker, const VeParameters& ve, std::vector<VeParameters> pool,
                        RunOptions& options) {
  PythonVolumeElements maker(worker, ve_options(ve));
  for (VeParameters& setup : pool) setup.cache = writable_cache(setup, options.folder);
  PreparedRun prepared;
  prepared.states = make_templates(maker, pool, [&](std::string_view line) {
    std::cout << line << std::endl;
    options.remarks.emplace_back(line);
  });
  options.versions.merge(engine_versions(maker));
  const EngineVerdict verdict = choose_engine(ve.engine, worker, prepared.states);
  options.remarks.push_back(verdict.sentence);
  prepared.engine = verdict.engine;
  return prepared;
}

WorkerCommand worker_command(const VeParameters& ve) {
  WorkerCommand command;
  command.sorted_contacts = ve.sorted_contacts;
  return command;
}

std::unique_ptr<LocalPoints> make_local_points(EngineKind engine, WorkerProcess& worker, const VeParameters& ve,
                                               double trials, const std::filesystem::path& evidence, int ranks) {
  VolumeElementOptions options = ve_options(ve);
  options.say = [](std::string_view remark) { std::cerr << remark << std::endl; };
  if (engine == EngineKind::yade) return std::make_unique<PythonVolumeElements>(worker, std::move(options));
  CompactOptions compact;
  compact.threads = ve.threads > 0 ? ve.threads : processors(ranks);
  compact.check_share = ve.check_every > 0 ? 1.0 / ve.check_every : kChecksOfARun / std::max(trials, 1.0);
  compact.evidence = evidence;
  return std::make_unique<CompactVolumeElements>(worker, std::move(options), std::move(compact));
}

std::string describe(const EngineCheck& check) {
  if (check.trials == 0) return {};
  return fmt::format("{} of {} trials equal YADE's to the bit", check.equal, check.trials);
}

}  // namespace femxdem
