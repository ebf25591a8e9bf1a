#include "history.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <fstream>

#include "disk_file.hpp"
#include "errors.hpp"

namespace femxdem {
namespace {

std::string header(const std::vector<std::string>& monitors) {
  return fmt::format("{}\n", fmt::join(history_columns(monitors), ","));
}

/// Header and rows up to the last step; a row that a killed run left unfinished lacks columns and is dropped.
std::string kept_rows(const std::filesystem::path& file, const std::string& expected_header, int last_step) {
  std::ifstream stream(file);
  std::string line;
  std::getline(stream, line);
  if (line + "\n" != expected_header) {
    throw UserError(
        fmt::format("{}: has other columns than this case; restart with the case that wrote it", file.string()));
  }
  const auto columns = std::count(line.begin(), line.end(), ',');
  std::string rows = expected_header;
  while (std::getline(stream, line)) {
    if (std::count(line.begin(), line.end(), ',') == columns && std::stoi(line) <= last_step) rows += line + "\n";
  }
  return rows;
}

}  // namespace

std::vector<std::string> history_columns(const std::vector<std::string>& own) {
  std::vector<std::string> names = {"step",        "time",      "load_factor", "iterations",
                                    "evaluations", "dem_steps", "histories",   "residual"};
  names.insert(names.end(), own.begin(), own.end());
  names.insert(names.end(), {"dem_seconds", "wall_s"});
  return names;
}

History::History(const std::filesystem::path& file, const std::vector<std::string>& monitors, Existing existing,
                 int last_step)
    : file_(file), monitors_(monitors.size()) {
  const bool goes_on = existing == Existing::resume && std::filesystem::exists(file);
  replace_file(file, goes_on ? kept_rows(file, header(monitors), last_step) : header(monitors));
  stream_.emplace(file, true);
}

void History::add(const StepRecord& record) {
  assert(record.monitors.size() == monitors_);
  if (!stream_->is_in_place()) throw DiskError(fmt::format("{}: {}", file_.string(), kTakenAway));
  std::string row =
      fmt::format("{},{:.17g},{:.17g},{},{},{:.17g},{},{:.17g}", record.step, record.time, record.load_factor,
                  record.iterations, record.evaluations, record.dem_steps, record.histories, record.residual);
  for (const double value : record.monitors) row += fmt::format(",{:.17g}", value);
  row += fmt::format(",{:.6g},{:.6g}\n", record.dem_seconds, record.wall_seconds);
  stream_->write(row);
}

}  // namespace femxdem
