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

/// Why compact cells may not stand for this template, and whether they alone can.
struct Opinion {
  std::optional<std::string> objection;
  bool only_compact = false;
};

std::optional<std::string> difference(Referee& referee, const std::string& state, const CompactCell& cell) {
  referee.add_origin(hash(state), state);
  Straining straining;
  straining.steps = kSteps;
  const double rate = 1e-2 / cell.info().time_scale;  // a general stretch at an inertial number of about 1e-2
  straining.velocity_gradient = {0.3 * rate, 0.1 * rate, 0, 0.1 * rate, -rate, 0.2 * rate, 0, 0.2 * rate, 0.2 * rate};
  CompactCell strained = cell;
  if (const auto end = strained.deform(straining.velocity_gradient, straining.steps); end.failure) return *end.failure;
  return referee.difference(hash(state), cell, straining, strained);
}

Opinion opinion(Referee& referee, const std::string& state) {
  const ExportedScene exported = referee.exported(state);
  if (!exported.covered) return {"they do not cover it: " + exported.bytes};
  const CompactCell cell = CompactCell::from_scene(exported.bytes);
  if (!cell.law_of_yade()) return {std::nullopt, true};
  return {difference(referee, state, cell)};
}

std::string praise(std::size_t compared, std::size_t only_compact) {
  std::string sentence = "engine: compact cells";
  if (compared > 0)
    sentence += fmt::format("; every {}template equals YADE's to the bit over {} steps",
                            only_compact > 0 ? "other " : "", kSteps);
  if (only_compact > 0)
    sentence += fmt::format(
        "; {} of {} templates have ve.contact_law = \"paper\", which YADE has not: it repeats none of "
        "their trials, the law is checked against the closed form of two spheres "
        "(validation/contact_laws)",
        only_compact, compared + only_compact);
  return sentence;
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
  std::string objection;
  std::size_t only_compact = 0;
  for (std::size_t t = 0; t < states.size(); ++t) {
    const Opinion one = opinion(referee, states[t]);
    only_compact += one.only_compact;
    if (one.objection && objection.empty())
      objection =
          fmt::format("volume element {} of {} cannot be a compact cell: {}", t + 1, states.size(), *one.objection);
  }
  if (objection.empty()) return {EngineKind::compact, praise(states.size() - only_compact, only_compact)};
  if (only_compact > 0)
    throw UserError(objection + "; others have ve.contact_law = \"paper\", which YADE has not: give them another law");
  if (asked == EngineChoice::compact) throw UserError(objection + "; set ve.engine = \"auto\" or \"yade\"");
  return {EngineKind::yade, "engine: YADE; " + objection};
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
  if (ve.answer == VeAnswer::mean)
    options.remarks.emplace_back("stresses are means over trials: curves and fields are of mid-step (ve.answer)");
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
