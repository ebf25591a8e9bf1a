#pragma once

#include <string>
#include <string_view>

#include "compact_block.hpp"

namespace femxdem {

/// What yade_scripts/compact_scene.py exports of a YADE scene and writes back into one; the format is this, numbers of
/// eight bytes in the machine's order, arrays without a gap:
///   "fxdscene"; whole numbers: version 2, law (CompactLaw), spheres n, contacts m, iteration, start vectors (0 or 1);
///   numbers: time step, damping, H (9), trsf (9), L (9), P (9), adhesion and friction of new contacts (NaN: none),
///   kn and ks of new contacts (NaN: from the materials), safety of the time step (NaN: it follows nothing), density,
///   mean diameter, volume of the grains, viscous damping (of the paper's law);
///   of the spheres: x, v, w, f, t (n, 3 each), rotation since the reference (n, 4), radius, mass, inertia, young,
///   poisson, tangent of the friction angle (n each);
///   of the contacts: whole numbers ids (m, 2), shift (m, 3), waits for adhesion (m); numbers kn, ks, normal adhesion,
///   shear adhesion, unp, unpMax, tangent, fragile, broken, normal force (m each), shear force, normal (m, 3 each);
///   if there are: start vectors (2, n, 3).
/// Under the paper's law, which YADE has not, the forces are found anew from the places; unp is f_c / kn, with which
/// YADE's cohesive law gives the same ones while the spheres overlap, apart from dashpots and attraction that slides.
/// Throws UserError when `exported` is something else.
CompactBlock block_of_scene(std::string_view exported);
std::string scene_of_block(const CompactBlock& block);

/// Whether two exports are equal to the bit, but for the grains' rotations since the reference, which decide nothing
/// and are products of quaternions: those within 1e-12. Throws UserError when one is something else.
bool same_state(std::string_view one, std::string_view other);

}  // namespace femxdem
