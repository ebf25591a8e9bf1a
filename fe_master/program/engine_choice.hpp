#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "case.hpp"
#include "material_points.hpp"
#include "run_files.hpp"
#include "ve_state.hpp"
#include "worker_process.hpp"

namespace femxdem {

/// Which engine strains a run's volume elements, and why.
struct EngineVerdict {
  EngineKind engine = EngineKind::yade;
  std::string sentence;  ///< for the log
};

/// What ve.engine asks for. Compact cells are taken where they cover every template and where each template, strained
/// in both engines for 20 steps, ends in the same state to the bit; else "auto" is YADE and the sentence says why, and
/// "compact" is a UserError. The paper's law is one that YADE has not: such a template is compact without a comparison,
/// and a UserError where another one has to be YADE's. states: of the templates, as make_templates gives them.
EngineVerdict choose_engine(EngineChoice asked, WorkerProcess& worker, const std::vector<std::string>& states);

/// What a run on volume elements starts from: the states of its pool, and the engine that strains them.
struct PreparedRun {
  std::vector<std::string> states;
  EngineKind engine = EngineKind::yade;
};
/// Takes or makes the volume elements of the pool and chooses the engine that `ve` asks for. What there is to say goes
/// to the terminal and to the options' remarks, versions to theirs.
PreparedRun prepare_run(WorkerProcess& worker, const VeParameters& ve, std::vector<VeParameters> pool,
                        RunOptions& options);

/// The worker of a rank for these volume elements.
WorkerCommand worker_command(const VeParameters& ve);

/// The volume elements of this rank. trials: how many the run expects of all ranks, for the sample that YADE repeats;
/// evidence: where the data of a trial go that it answers otherwise; ranks: on this machine, which share its
/// processors.
std::unique_ptr<LocalPoints> make_local_points(EngineKind engine, WorkerProcess& worker, const VeParameters& ve,
                                               double trials, const std::filesystem::path& evidence, int ranks);

/// "23 of 23 trials equal YADE's to the bit", or nothing where none was repeated.
std::string describe(const EngineCheck& check);

}  // namespace femxdem
