#include "compact_cell.hpp"

#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "compact_report.hpp"
#include "compact_scene.hpp"
#include "compact_step.hpp"
#include "contact_network.hpp"

namespace femxdem {
namespace {

constexpr std::array<double, 2> kKept = {0.6, 1.1};  ///< time step over the safe one that is left alone (time_step.py)

/// Norm of the symmetric part of L [1/s].
double rate(const Row3& L) {
  double sum = 0;
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c) sum += std::pow(L[3 * r + c] + L[3 * c + r], 2);
  return std::sqrt(sum) / 2;
}

/// The weighted mean of a quantity over `steps` steps from samples, by the trapezoidal rule. mean_stress.py does the
/// same operations in the same order.
class Mean {
 public:
  Mean(long steps, double late) : steps_(static_cast<double>(steps)), late_(late) {}
  void add(long step, const Row3& value) {
    const double weight = 1 + late_ * (2 * static_cast<double>(step) / steps_ - 1);
    for (std::size_t k = 0; k < 9; ++k) {
      const double weighted = weight * value[k];
      if (count_ > 0) sum_[k] += 0.5 * static_cast<double>(step - last_step_) * (last_[k] + weighted);
      last_[k] = weighted;
    }
    last_step_ = step;
    ++count_;
  }
  Row3 mean() const {
    Row3 mean;
    for (std::size_t k = 0; k < 9; ++k) mean[k] = sum_[k] / steps_;
    return mean;
  }

 private:
  double steps_, late_;
  Row3 sum_{}, last_{};
  long last_step_ = 0, count_ = 0;
};

}  // namespace

CompactCell::CompactCell() = default;
CompactCell::CompactCell(CompactCell&&) noexcept = default;
CompactCell& CompactCell::operator=(CompactCell&&) noexcept = default;
CompactCell::~CompactCell() = default;

CompactCell::CompactCell(const CompactCell& other) { *this = other; }

CompactCell& CompactCell::operator=(const CompactCell& other) {
  if (this == &other) return *this;
  if (!other.block_)
    block_.reset();
  else if (block_)
    block_->assign(*other.block_);
  else
    block_ = std::make_unique<CompactBlock>(*other.block_);
  trial_ = other.trial_;
  return *this;
}

CompactCell CompactCell::from_scene(std::string_view exported) {
  CompactCell cell;
  cell.block_ = std::make_unique<CompactBlock>(block_of_scene(exported));
  return cell;
}

CompactCell CompactCell::load(std::string_view saved) {
  CompactCell cell;
  cell.block_ = std::make_unique<CompactBlock>(saved);
  return cell;
}

std::string CompactCell::save() const { return block_->save(); }

std::string CompactCell::to_scene() const { return scene_of_block(*block_); }
std::size_t CompactCell::memory() const { return block_->memory(); }
std::size_t CompactCell::size() const { return block_->header().spheres; }

CompactCell::Deformed CompactCell::deform(const Row3& L, long steps, Sampling sampling) {
  const auto started = std::chrono::steady_clock::now();
  Deformed result;
  result.mean_stress.fill(std::numeric_limits<double>::quiet_NaN());
  if (steps > 0) block_->header().L = L;
  Mean mean(steps, sampling.late);
  const bool sampled = sampling.every > 0 && steps > 0;
  try {
    if (sampled) mean.add(0, stress());
    for (long k = 1; k <= steps; ++k) {
      step(*block_);
      if (sampled && (k % sampling.every == 0 || k == steps)) mean.add(k, stress());
    }
  } catch (const std::runtime_error& reason) {
    result.failure = reason.what();
  }
  if (sampling.every > 0 && !result.failure) result.mean_stress = sampled ? mean.mean() : stress();
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - started;
  trial_ = {static_cast<double>(steps), rate(L), taken.count()};
  return result;
}

void CompactCell::rest() { femxdem::rest(*block_); }

std::optional<std::string> CompactCell::hold(long steps) {
  const CompactTrial strained = trial_;
  std::optional<std::string> failure = deform(Row3{}, steps).failure;
  trial_ = {strained.steps + trial_.steps, strained.rate, strained.seconds + trial_.seconds};
  return failure;
}

bool CompactCell::law_of_yade() const { return block_->header().law != CompactLaw::paper; }

bool CompactCell::flip() { return femxdem::flip(*block_); }

Row3 CompactCell::stress() const { return symmetrised(love_weber(block_->arrays())); }
Row3 CompactCell::stretch() const { return block_->header().trsf; }
PointReport CompactCell::trial_report() const { return femxdem::trial_report(block_->arrays(), trial_); }
void CompactCell::complete(PointReport& report) const { complete_report(block_->arrays(), trial_, report); }
double CompactCell::time_step() const { return block_->header().time_step; }

PointReport CompactCell::report() const {
  PointReport whole = trial_report();
  complete(whole);
  return whole;
}

VeInfo CompactCell::info() const {
  const CompactHeader& h = block_->header();
  const double pressure = femxdem::pressure(love_weber(block_->arrays()));
  return {h.time_step, time_scale(h, pressure), pressure};
}

std::array<double, 81> CompactCell::stiffness(VeStiffness kind) const {
  const std::vector<Spring> network = springs(block_->arrays(), kind);
  const CompactHeader& h = block_->header();
  const double volume = determinant(h.H);
  return kind == VeStiffness::relaxed ? relaxed_stiffness(h.spheres, network, volume)
                                      : affine_stiffness(network, volume);
}

void CompactCell::follow_network() {
  CompactHeader& h = block_->header();
  const CompactArrays& a = block_->arrays();
  if (std::isnan(h.safety) || !h.start_vectors || h.contacts == 0) return;
  std::vector<NetworkGrain> grains;
  for (std::size_t s = 0; s < h.spheres; ++s) grains.push_back({a.mass[s], a.inertia[s], a.spheres[s].radius});
  const std::vector<Spring> network = springs(a);
  const double safe = h.safety * critical_time_step(grains, network, {a.start, std::size_t{6} * h.spheres});
  const double ratio = h.time_step / safe;
  if (!(kKept[0] <= ratio && ratio <= kKept[1])) h.time_step = safe;
}

}  // namespace femxdem
