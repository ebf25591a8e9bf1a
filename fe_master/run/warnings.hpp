#pragma once

#include <string>
#include <vector>

#include "analytic_laws.hpp"
#include "case.hpp"
#include "double_stress.hpp"
#include "mesh.hpp"

namespace femxdem {

/// Moduli that set the thickness of a shear band [Pa].
struct BandModuli {
  double softening = 0;  ///< |a|: the most negative eigenvalue of the acoustic tensor n.C.n of the tangent is -|a|
  double elastic = 0;    ///< the elastic eigenvalue A1 along the same eigenvector
};

/// Moduli of a law in closed form where it softens most in plane-strain compression along x2 at constant lateral
/// stress, up to 5 % of strain after the first yield; all zero when it does not localise there.
BandModuli band_moduli(const AnalyticLaw& law);

/// Moduli of volume elements, from coupled runs: cohesive VEs of 200 spheres, kappa = 500, p* = 1, gave bands of 0.43 W
/// and 0.26 W (full width at half height, half of the patch) at D = 0.025 and 0.01 sigma_0 W^2: |a| = 1.4 sigma_0; A1
/// of the order of kappa sigma_0.
BandModuli band_moduli(const VeParameters& ve);

/// Width of the softening patch of a band, w = 2 sqrt(D / |a|) (pi - atan sqrt(|a| / A1)) [m] (Chambon, Caillerie, El
/// Hassan 1998); the strain's full width at half height is about half of it. D [N].
double expected_band_width(double D, const BandModuli& moduli);

/// Modulus D [N] of a double-stress law across a band: least eigenvalue of law_ijklmn n_j n_k n_m n_n, n = e1.
double band_modulus(const DoubleStiffness& law);

/// What a user should know before the run, one sentence each, with numbers: too few elements across the expected band;
/// identical points without an imperfection where the law softens; a multiplier that is not determined.
std::vector<std::string> warnings(const Case& c, const Mesh& mesh);

/// What a case's ve.preset stands for: its measured errors, and the mesh that goes with it, which it cannot set. Empty
/// without a preset.
std::string preset_advice(const Case& c, const Mesh& mesh);

}  // namespace femxdem
