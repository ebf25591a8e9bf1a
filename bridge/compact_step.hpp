#pragma once

#include "compact_block.hpp"

namespace femxdem {

/// C = A B, sums as everywhere in the step: a0 b0 + (a1 b1 + a2 b2).
Row3 product(const Row3& A, const Row3& B);
/// By the first column's minors in YADE's order.
double determinant(const Row3& A);
Row3 inverse(const Row3& A);

/// Distances of opposite faces of the cell [m].
std::array<double, 3> widths(const Row3& inverse_H);
/// How far the largest spheres are from touching one another twice [m].
double room(const CompactHeader& header);
/// A cell that has become long becomes a shorter one of the same lattice; places, contacts and forces stay. Whether it
/// was too long. Throws std::runtime_error when a cell shift becomes too large.
bool flip(CompactBlock& block);

/// The list of pairs that may come to touch, made anew. Throws std::runtime_error with the sentence when the cell has
/// become too narrow for its largest spheres.
void make_list(CompactBlock& block);

/// One DEM step from rest to rest: flip of the cell, integrator, cell, list, contacts. Throws what make_list throws.
void step(CompactBlock& block);

/// The contact forces of now, found again without a slip; contacts whose end has come are lost.
void find_forces(CompactBlock& block);
/// Spheres and cell stand still from now on, and so do the dashpots.
void rest(CompactBlock& block);

/// The class of contacts that form with that tangent of the friction angle.
std::uint32_t class_of_new(const CompactArrays& arrays, double tangent);

}  // namespace femxdem
