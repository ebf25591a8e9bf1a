#include "compact_volume_elements.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <exception>
#include <fstream>
#include <map>
#include <mutex>
#include <numeric>
#include <set>
#include <system_error>
#include <thread>
#include <utility>

#include "errors.hpp"
#include "hash.hpp"

namespace femxdem {
namespace {

/// A number in [0, 1) that the trial's number and the point decide (splitmix64, Steele, Lea, Flood 2014).
double drawn(std::uint64_t trial) {
  std::uint64_t z = trial * 0x9e3779b97f4a7c15ull + 0x9e3779b97f4a7c15ull;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

/// Order of F, bit by bit.
struct ByBits {
  bool operator()(const Tensor2& a, const Tensor2& b) const { return std::memcmp(a.data(), b.data(), sizeof a) < 0; }
};

/// Trials by what decides them: the cell that they start from, DEM steps, and the stretch at their end.
using TrialNumbers = std::map<std::pair<const CompactCell*, long>, std::map<Tensor2, std::size_t, ByBits>>;

}  // namespace

CompactVolumeElements::CompactVolumeElements(WorkerProcess& worker, VolumeElementOptions options,
                                             CompactOptions compact)
    : worker_(worker), options_(std::move(options)), compact_(std::move(compact)), referee_(worker) {
  options_.quantised = true;
}

CompactVolumeElements::Point CompactVolumeElements::point_of(const std::string& state) {
  const std::optional<VeState> saved = decode(state);
  Point point;
  if (saved && saved->engine == EngineKind::compact) {
    point.cell = std::make_shared<CompactCell>(CompactCell::load(saved->bytes));
    point.strained.origin = saved->origin;
    point.strained.reference_time_scale = saved->reference_time_scale;
  } else {
    const std::string& scene = saved ? saved->bytes : state;
    const ExportedScene exported = referee_.exported(scene);
    if (!exported.covered)
      throw UserError(fmt::format("volume element: the compact engine does not cover it: {}; set ve.engine = \"yade\"",
                                  exported.bytes));
    point.cell = std::make_shared<CompactCell>(CompactCell::from_scene(exported.bytes));
    point.strained.origin = saved ? saved->origin : hash(scene);
    if (!saved && point.cell->law_of_yade()) referee_.add_origin(point.strained.origin, scene);
    const VeInfo info = point.cell->info();
    if (!saved) require_time_scale(info.time_scale, info.time_step, info.mean_stress);
    point.strained.reference_time_scale = saved ? saved->reference_time_scale : info.time_scale;
  }
  adopt(point, tensor(point.cell->stress()));
  return point;
}

void CompactVolumeElements::adopt(Point& point, const Tensor2& stress) const {
  point.strained.stretch = tensor(point.cell->stretch());
  point.strained.level = network_level(point.strained.stretch, stress);
  point.strained.frozen_steps = 0;
  point.time_step = point.cell->time_step();
}

void CompactVolumeElements::add(const std::string& state, std::size_t count) {
  if (count == 0) return;
  const Point point = point_of(state);
  points_.insert(points_.end(), count, point);
  count_memory();
}

void CompactVolumeElements::remove(std::size_t index) {
  points_.erase(points_.begin() + static_cast<std::ptrdiff_t>(index));
  trials_.clear();
  trial_pending_ = false;
}

void CompactVolumeElements::begin_step() {
  for (Point& point : points_) point.strained.frozen_steps = 0;
}

std::vector<double> CompactVolumeElements::costs(std::span<const Tensor2> F) const {
  std::vector<double> costs(size());
  for (std::size_t p = 0; p < size(); ++p) {
    StrainedPoint point = points_[p].strained;
    const Straining plan = plan_straining(options_, point, points_[p].time_step, p, F[p]);
    costs[p] = plan.refusal ? 0 : trial_cost(static_cast<double>(plan.steps), points_[p].report["contacts"]);
  }
  return costs;
}

std::vector<Response> CompactVolumeElements::evaluate(std::span<const Tensor2> F, Operator wanted) {
  require_answerable(wanted, F.size(), size());
  std::vector<Straining> plans(F.size());
  in_parallel(size(), [&](std::size_t p) {
    plans[p] = plan_straining(options_, points_[p].strained, points_[p].time_step, p, F[p]);
  });
  group(plans);
  const std::vector<std::size_t> order = longest_first();
  in_parallel(order.size(), [&](std::size_t t) { strain(trials_[order[t]], wanted); });
  count_memory();
  for (Trial& trial : trials_) {
    if (trial.checked) check(trial);
  }
  std::vector<Response> responses(size());
  for (std::size_t p = 0; p < size(); ++p) {
    const Trial& trial = trials_[trial_of_point_[p]];
    responses[p].report = trial.report;
    responses[p].failure = plans[p].refusal;
    if (trial.failure) responses[p].failure = Failure{p, *trial.failure, kSmallerStep};
    if (!responses[p].failure) judge(options_, plans[p], p, trial.found, responses[p]);
  }
  trial_pending_ = true;
  trial_failed_ = std::any_of(responses.begin(), responses.end(), [](const Response& r) { return r.failure; });
  return responses;
}

std::vector<std::size_t> CompactVolumeElements::longest_first() const {
  std::vector<std::size_t> order(trials_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return trials_[a].straining.steps > trials_[b].straining.steps;
  });
  return order;
}

/// Points that start from the same cell and ask for the same of it make one trial; what the last trial has made is
/// kept.
void CompactVolumeElements::group(const std::vector<Straining>& plans) {
  std::vector<Trial> last = std::exchange(trials_, {});
  TrialNumbers made, known;
  for (std::size_t t = 0; t < last.size(); ++t) {
    if (last[t].from != nullptr && !last[t].failure)
      made[{last[t].from, last[t].straining.steps}][last[t].straining.U] = t;
  }
  trial_of_point_.assign(size(), 0);
  for (std::size_t p = 0; p < size(); ++p) {
    if (plans[p].refusal) {
      trial_of_point_[p] = trials_.size();
      trials_.emplace_back().first = p;
      continue;
    }
    const std::pair start{static_cast<const CompactCell*>(points_[p].cell.get()), plans[p].steps};
    const auto [entry, added] = known[start].try_emplace(plans[p].U, trials_.size());
    trial_of_point_[p] = entry->second;
    if (!added) continue;
    Trial& trial = trials_.emplace_back();
    if (const auto earlier = made[start].find(plans[p].U); earlier != made[start].end()) {
      trial = std::move(last[earlier->second]);
      trial.kept = true;
    }
    trial.from = start.first;
    trial.first = p;
    trial.straining = plans[p];
    trial.checked = !trial.kept && plans[p].steps > 0 && referee_.knows(points_[p].strained.origin) &&
                    drawn(drawn_++) < compact_.check_share;
  }
  give_cells(std::move(last));
}

/// A cell for each trial that has to be made; those of the last trials that are not kept are free again.
void CompactVolumeElements::give_cells(std::vector<Trial> last) {
  for (Trial& trial : last) spare_.push_back(std::move(trial.cell));
  std::erase_if(spare_, [](const Cell& cell) { return cell == nullptr || cell.use_count() > 1; });
  for (Trial& trial : trials_) {
    if (trial.from != nullptr && !trial.kept) trial.cell = spare_cell();
  }
}

CompactVolumeElements::Cell CompactVolumeElements::spare_cell() {
  if (spare_.empty()) return std::make_shared<CompactCell>();
  Cell cell = std::move(spare_.back());
  spare_.pop_back();
  return cell;
}

/// The work of `count` items by the threads of this rank; items are taken in order, as threads become free. Where the
/// system gives fewer threads, fewer work; what one of them throws is thrown once all have ended.
template <class Work>
void CompactVolumeElements::in_parallel(std::size_t count, Work work) const {
  std::atomic<std::size_t> next{0};
  std::exception_ptr thrown;
  std::mutex guard;
  const auto serve = [&] {
    try {
      for (std::size_t item = next++; item < count; item = next++) work(item);
    } catch (...) {  // thrown again below
      const std::lock_guard hold(guard);
      thrown = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> helpers;
    try {
      for (std::size_t t = 1; t < std::min<std::size_t>(static_cast<std::size_t>(compact_.threads), count); ++t)
        helpers.emplace_back(serve);
    } catch (const std::system_error&) {  // no more of them
    }
    serve();
  }
  if (thrown) std::rethrow_exception(thrown);
}

void CompactVolumeElements::strain(Trial& trial, Operator wanted) const {
  if (trial.cell == nullptr) return;
  if (trial.kept) {
    for (const char* spent : {"dem_steps", "seconds", "engine_seconds"}) trial.report[spent] = 0;
  } else {
    deform(trial);
  }
  if (trial.failure) return;
  trial.found.stiffness.reset();
  if (wanted == Operator::elastic)
    trial.found.stiffness = Eigen::Map<const Tensor4>(trial.cell->stiffness(options_.stiffness).data());
}

void CompactVolumeElements::deform(Trial& trial) const {
  CompactCell& cell = *trial.cell;
  cell = *trial.from;
  const long steps = trial.straining.steps;
  const CompactCell::Sampling sampling = answers_mean(options_)
                                             ? CompactCell::Sampling{sample_every(steps), lateness(options_, steps)}
                                             : CompactCell::Sampling{};
  if (options_.start_at_rest && steps > 0) cell.rest();
  const CompactCell::Deformed end = cell.deform(trial.straining.velocity_gradient, steps, sampling);
  trial.failure = end.failure;
  if (!trial.failure && steps > 0) trial.failure = cell.hold(options_.hold_steps);
  if (trial.failure) return;
  trial.report = cell.trial_report();
  trial.found = {
      answers_mean(options_) ? tensor(end.mean_stress) : end_stress(trial.report), tensor(cell.stretch()), {}};
}

void CompactVolumeElements::check(const Trial& trial) {
  if (trial.failure) return;
  const Point& point = points_[trial.first];
  ++check_.trials;
  const auto difference = referee_.difference(point.strained.origin, *point.cell, trial.straining, *trial.cell);
  if (!difference) {
    ++check_.equal;
    return;
  }
  const std::filesystem::path file = compact_.evidence / fmt::format("engine_difference_{}.state", trial.first);
  std::ofstream(file, std::ios::binary) << save_one(trial.first);
  std::string L;
  for (const double value : trial.straining.velocity_gradient) L += fmt::format(" {:a}", value);
  std::ofstream(file.string() + ".txt") << fmt::format("steps {}\nvelocity_gradient{}\n", trial.straining.steps, L);
  throw EngineDiffers(
      fmt::format("compact volume element {}: {}; its state and the trial are in {}; set ve.engine = "
                  "\"yade\" and report it",
                  trial.first, *difference, file.string()));
}

void CompactVolumeElements::commit() {
  if (size() == 0) return;
  require_committable(trial_pending_, trial_failed_);
  std::vector<Point> ends(trials_.size());
  in_parallel(trials_.size(), [&](std::size_t t) {
    CompactCell& cell = *trials_[t].cell;
    Point& end = ends[t] = points_[trials_[t].first];
    end.cell = trials_[t].cell;
    end.report = trials_[t].report;
    cell.complete(end.report);
    const NetworkLevel before = end.strained.level;
    adopt(end, end_stress(end.report));
    if (end.strained.level == before) return;
    cell.follow_network();
    end.time_step = cell.time_step();
  });
  for (std::size_t p = 0; p < size(); ++p) {
    Point& end = ends[trial_of_point_[p]];
    if (points_[p].cell.use_count() == 1) spare_.push_back(points_[p].cell);
    points_[p].cell = end.cell;
    points_[p].strained.stretch = end.strained.stretch;
    points_[p].strained.level = end.strained.level;
    points_[p].time_step = end.time_step;
    points_[p].report = end.report;
  }
  trials_.clear();
  trial_pending_ = false;
  begin_step();
}

std::vector<PointReport> CompactVolumeElements::reports() {
  std::vector<PointReport> reports;
  for (const Point& point : points_) reports.push_back(point.report);
  return reports;
}

std::string CompactVolumeElements::save_one(std::size_t index) {
  const Point& point = points_.at(index);
  return encode({EngineKind::compact, point.strained.reference_time_scale, point.strained.origin, point.cell->save()});
}

void CompactVolumeElements::save_each(const TakeState& take) {
  StateSource cells;  // points of one cell have one state
  std::map<const CompactCell*, int> number_of;
  for (const Point& point : points_)
    cells.number_of_point.push_back(
        number_of.emplace(point.cell.get(), static_cast<int>(number_of.size())).first->second);
  for (const auto& [cell, points] : cells.points_of_states()) take(save_one(points.front()), points);
}

void CompactVolumeElements::load_into(std::span<const std::size_t> points, const std::string& state) {
  const Point loaded = point_of(state);
  for (const std::size_t p : points) {
    require_origin(loaded.strained.origin, points_.at(p).strained.origin);
    points_[p] = loaded;
  }
  trials_.clear();
  trial_pending_ = false;
}

void CompactVolumeElements::count_memory() {
  std::set<const CompactCell*> cells;
  std::uint64_t sum = 0;
  const auto count = [&](const Cell& cell) {
    if (cell && cells.insert(cell.get()).second) sum += cell->memory();
  };
  for (const Point& point : points_) count(point.cell);
  for (const Trial& trial : trials_) count(trial.cell);
  for (const Cell& cell : spare_) count(cell);
  peak_memory_ = std::max(peak_memory_, sum);
}

}  // namespace femxdem
