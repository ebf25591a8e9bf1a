#pragma once

#include <memory>
#include <string>
#include <vector>

#include "case.hpp"
#include "material_points.hpp"
#include "run_files.hpp"

namespace femxdem {

/// Reads a case for a single material point. A boundary value problem without [[path]] gets that of biaxial_path, so
/// that one file serves the problem and its volume element. Throws UserError as read_case does.
Case read_path_case(const std::string& file, const std::vector<std::string>& overrides);

/// The plane-strain biaxial path that a boundary value problem's material would follow if it stayed homogeneous:
/// stress_xx kept at the lateral pressure (the first pressure load, else the initial stress), no strain along z, no
/// shear, strain_yy to the end of the loading along y (of a rectangle; else ln 0.95), in increments of about 1e-3.
PathSegment biaxial_path(const Case& c);

/// The point of a case whose material is a law in closed form.
std::unique_ptr<MaterialPoints> make_analytic_point(const Case& c);

/// Follows the case's [[path]] with ONE material point and writes history.csv, summary.json, case.toml and log.txt.
/// Columns beside those of a run: strain_* (ln V, F = V R), stress_* (Cauchy [Pa], tension positive), F_11 .. F_33,
/// the point's report, and stress_noise (PathDriver::noise over noise_samples strains within solver.qn_noise) when
/// noise_samples > 0; time counts segments; row 0 is the start. Steps are cut and grown within the segment's increment.
/// Told to end it saves between two steps, as a run does. Returns the exit status.
int follow_path(const Case& c, MaterialPoints& point, const RunOptions& options, int noise_samples = 0);

}  // namespace femxdem
