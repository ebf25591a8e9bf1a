#include "preset.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace femxdem {
namespace {

const std::map<VePreset, Preset> kPresets = {
    {VePreset::fast, {"fast", 100, 2e-2, 10, 2e-3, 1e-2, 4, 0.082, 0.11, 0.23, 0.093}},
    {VePreset::balanced, {"balanced", 400, 5e-3, 3, 1e-3, 5e-3, 6, 0.067, 0.032, 0.12, 0.048}},
    {VePreset::accurate, {"accurate", 1000, 5e-3, 3, 5e-4, 5e-3, 8, 0.031, 0.022, 0.058, 0.03}}};

/// Largest displacement in a second [m/s]: of value x factor of a load of that kind.
double fastest(const Load& load, double end_time) {
  if (load.table.empty()) return std::abs(load.value) / (load.kind == LoadKind::velocity ? 1.0 : end_time);
  double slope = 0;
  for (std::size_t i = 1; i < load.table.size(); ++i) {
    const auto& [t0, f0] = load.table[i - 1];
    const auto& [t1, f1] = load.table[i];
    slope = std::max(slope, std::abs((f1 - f0) / (t1 - t0)));
  }
  return std::abs(load.value) * slope;
}

}  // namespace

const Preset& preset(VePreset which) { return kPresets.at(which); }

double strain_rate(const Case& c) {
  if (c.mesh.type != MeshType::rectangle || c.control.mode != ControlMode::time) return kNotGiven;
  double rate = 0;
  for (const Load& load : c.loads) {
    if (load.edge.empty() || (load.kind != LoadKind::displacement && load.kind != LoadKind::velocity)) continue;
    const bool along_y = load.edge == "top" || load.edge == "bottom";
    rate += fastest(load, c.control.end_time) / (along_y ? c.mesh.height : c.mesh.width);
  }
  return rate > 0 ? rate : kNotGiven;  // also of keys that are missing, which are not numbers
}

void complete_by_preset(Case& c, const Mistakes& mistakes) {
  if (c.ve.preset == VePreset::none || !on_volume_elements(c)) return;
  const Preset& values = preset(c.ve.preset);
  if (!mistakes.has("solver.tolerance")) c.solver.tolerance = values.tolerance;
  const double step = values.increment / strain_rate(c);
  if (!mistakes.has("control.step") && is_given(step)) c.control.step = std::min(step, c.control.end_time);
}

}  // namespace femxdem
