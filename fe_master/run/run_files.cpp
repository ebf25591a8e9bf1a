#include "run_files.hpp"

#include <fmt/format.h>

namespace femxdem {

RunFiles::RunFiles(const Case& c, const RunOptions& options)
    : lock_(options.lock ? options.lock : prepare_output_folder(options.folder, options.existing)),
      log(options.folder / "log.txt", options.existing, stdout, options.progress),
      options_(options) {
  replace_file(options.folder / "case.toml", effective_toml(c));
  summary.ranks = options.ranks;
  summary.case_hash = case_hash(c);
  summary.command_line = options.command_line;
  summary.versions = options.versions;
  if (!lock_->remark().empty()) log.say(lock_->remark());
  for (const std::string& remark : options.remarks) log.note(remark);
}

void RunFiles::begin_history(const std::vector<std::string>& columns, int last_step) {
  history_.emplace(options_.folder / "history.csv", columns, options_.existing, last_step);
}

void RunFiles::add(const StepRecord& record) {
  history_->add(record);
  summary.evaluations += record.evaluations;
  summary.dem_steps += record.dem_steps;
  summary.engine_seconds += record.dem_seconds;
}

void RunFiles::save(NamedArrays& arrays) const {
  arrays.emplace_back("run.counts", std::vector<double>{static_cast<double>(summary.evaluations), summary.dem_steps});
}

void RunFiles::load(int step, const NamedArrays& arrays) {
  const std::vector<double>& counts = find_array(arrays, "run.counts");
  summary.steps = step;
  summary.evaluations = static_cast<long>(counts.at(0));
  summary.dem_steps = counts.at(1);
}

void RunFiles::whole(double time) {
  whole_step_ = summary.steps;
  whole_time_ = time;
}

std::string RunFiles::stopped_by_the_disk(const std::string& reason) {
  const std::string state = last_checkpoint_
                                ? fmt::format("--restart goes on from the checkpoint after step {}", *last_checkpoint_)
                                : "there is no checkpoint to restart from";
  const std::string message = fmt::format("{}; the last whole step is {} (time {:g}), {}; make room and start again",
                                          reason, whole_step_, whole_time_, state);
  try {
    finish(kNotWritten, message);
  } catch (const DiskError&) {  // the same disk
  }
  return message;
}

int RunFiles::finish(int status, const std::string& message) {
  summary.status = status == kDone           ? "done"
                   : status == kNotConverged ? "not converged"
                   : status == kRunAgain     ? "stopped"
                                             : "failed";
  summary.message = message;
  summary.exit_status = status;
  summary.wall_seconds = wall();
  summary.peak_memory_master = peak_memory();
  options_.complete(summary);
  write_summary(options_.folder / "summary.json", summary);
  const std::string check = summary.engine_check.empty() ? "" : "; " + summary.engine_check;
  log.say(fmt::format("{}: {}{}", summary.status, message, check));
  return status;
}

}  // namespace femxdem
