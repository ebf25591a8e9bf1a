#include "referee.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "compact_scene.hpp"

namespace femxdem {
namespace {

#if defined(__x86_64__)
constexpr bool kToTheBit = true;
#else
constexpr bool kToTheBit = false;  // YADE may be compiled with fused operations there
#endif
constexpr double kRoundOff = 1e-13;

/// |a - b| / |b|.
double relative(const std::array<double, 9>& a, const std::array<double, 9>& b) {
  double difference = 0, size = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    difference += (a[k] - b[k]) * (a[k] - b[k]);
    size += b[k] * b[k];
  }
  return std::sqrt(difference / size);
}

}  // namespace

Referee::~Referee() {
  try {
    for (std::size_t k = 0; k < origins_.size(); ++k) worker_.request(Command::remove, 0);
  } catch (const std::exception&) {  // the worker is gone, and its scenes with it
  }
}

ExportedScene Referee::exported(const std::string& state) {
  const Reply reply = worker_.request(Command::export_scene, 0, 0, state);
  return {reply.value == 1, worker_.mail(reply)};
}

void Referee::add_origin(std::uint64_t origin, const std::string& state) {
  if (knows(origin)) return;
  worker_.request(Command::add, 1, 0, state);
  origins_.push_back(origin);
}

bool Referee::knows(std::uint64_t origin) const {
  return std::find(origins_.begin(), origins_.end(), origin) != origins_.end();
}

std::optional<std::string> Referee::difference(std::uint64_t origin, const CompactCell& committed,
                                               const Straining& straining, const CompactCell& trial) {
  const auto at = std::find(origins_.begin(), origins_.end(), origin);
  if (at == origins_.end()) throw std::logic_error("referee: no scene of this origin");
  std::string task(reinterpret_cast<const char*>(straining.velocity_gradient.data()), 9 * sizeof(double));
  task += committed.to_scene();
  const Reply reply = worker_.request(Command::referee, at - origins_.begin(), straining.steps, task);
  const std::string yades = worker_.mail(reply);
  if (kToTheBit && same_state(yades, trial.to_scene())) return std::nullopt;
  const double stress = relative(trial.stress(), CompactCell::from_scene(yades).stress());
  if (!kToTheBit && stress <= kRoundOff) return std::nullopt;
  return fmt::format("after {} DEM steps from the same state YADE ends in another one (stress {:.1e} apart, relative)",
                     straining.steps, stress);
}

}  // namespace femxdem
