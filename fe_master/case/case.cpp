#include "case.hpp"

#include <algorithm>
#include <map>
#include <random>

#include "formulation.hpp"
#include "mesh.hpp"

namespace femxdem {

VePool ve_pool(const Case& c, const Mesh& mesh) {
  const std::vector<int>& seeds = c.ve.seeds;
  std::mt19937 random(static_cast<unsigned>(c.ve.assignment_seed));
  std::vector<const VeParameters*> setup(mesh.elements.size(), &c.ve);
  for (const RegionVe& region : c.ve_regions) {
    for (int e : mesh.regions.at(region.region)) setup[e] = &region.ve;
  }
  VePool pool;
  std::map<std::pair<const VeParameters*, std::size_t>, int> number;
  for (const VeParameters* ve : setup) {
    const std::size_t draw = c.ve.assignment == Assignment::random ? random() % seeds.size() : 0;
    const auto [entry, added] = number.insert({{ve, draw}, static_cast<int>(pool.templates.size())});
    if (added) {
      pool.templates.push_back(*ve);
      if (!seeds.empty()) pool.templates.back().seed = seeds[draw];
    }
    pool.template_of_point.insert(pool.template_of_point.end(), kPointsPerElement, entry->second);
  }
  return pool;
}

std::vector<MaterialParameters> material_of_element(const Case& c, const Mesh& mesh) {
  std::vector<MaterialParameters> materials(mesh.elements.size(), c.material);
  for (const RegionMaterial& region : c.material_regions) {
    for (int e : mesh.regions.at(region.region)) materials[e] = region.material;
  }
  return materials;
}

}  // namespace femxdem
