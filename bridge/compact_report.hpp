#pragma once

#include <vector>

#include "compact_block.hpp"
#include "compact_cell.hpp"
#include "contact_network.hpp"
#include "material_points.hpp"

/// What a compact cell says of itself; definitions as yade_scripts/volume_element.py and YADE have them, sums in the
/// order of the ids.
namespace femxdem {

/// Stress of Love and Weber, tension positive, slightly asymmetric [Pa].
Row3 love_weber(const CompactArrays& arrays);
Row3 symmetrised(const Row3& stress);
double pressure(const Row3& stress);
/// a sqrt(rho/p) [s]; without pressure no rate is slow: infinite.
double time_scale(const CompactHeader& header, double pressure);
/// What judges and counts a trial; NaN in the rest.
PointReport trial_report(const CompactArrays& arrays, const CompactTrial& trial);
/// The rest of it, and what the trial has cost.
void complete_report(const CompactArrays& arrays, const CompactTrial& trial, PointReport& report);
/// The contacts as springs.
std::vector<Spring> springs(const CompactArrays& arrays, VeStiffness kind = VeStiffness::affine);

}  // namespace femxdem
