#include "case_completion.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "preset.hpp"

namespace femxdem {
namespace {

/// Slow trials of a boundary value problem answer with their mean, and where points do, a step's last correction is
/// learned: the choice of validation/quasi_static. A single element is drawn beside YADE's own tests: its ends.
void complete_answers(Case& c, Purpose purpose, const Mistakes& m) {
  const bool has_mean = c.ve.hold_steps == 0 && !reuses(c.solver);
  if (!m.has("ve.answer") && purpose == Purpose::run && has_mean && c.ve.inertial_number <= kSlowTrial)
    c.ve.answer = VeAnswer::mean;
  if (!m.has("solver.last_correction") && c.ve.answer == VeAnswer::mean && learns_whole_corrections(c.solver))
    c.solver.last_correction = LastCorrection::learned;
}

}  // namespace

void complete_case(Case& c, Purpose purpose, const Mistakes& m) {
  const bool ve = on_volume_elements(c);
  if (!m.has("solver.operator")) c.solver.global_operator = ve ? GlobalOperator::quasi_newton : GlobalOperator::tangent;
  complete_by_preset(c, m);
  c.solver = with_default_tolerances(c.solver, ve);
  if (!is_given(c.control.min_step)) c.control.min_step = c.control.step / 64.0;
  if (!is_given(c.control.max_step)) c.control.max_step = c.control.step;
  const auto complete_ve = [&](VeParameters& v, const auto& given) {
    if (v.contact_law == ContactLaw::friction && !given("cohesion")) v.cohesion = 0.0;
    complete_by_preset(v, given);
    if (!v.cache.empty()) v.cache = (std::filesystem::path(c.file).parent_path() / v.cache).lexically_normal().string();
  };
  const auto given = [&m](const std::string& key) { return m.has("ve." + key); };
  complete_ve(c.ve, given);
  for (std::size_t i = 0; i < c.ve_regions.size(); ++i)
    complete_ve(c.ve_regions[i].ve,
                [&](const std::string& key) { return given(key) || m.has(fmt::format("ve.region.{}.{}", i, key)); });
  if (ve) complete_answers(c, purpose, m);
}

}  // namespace femxdem
