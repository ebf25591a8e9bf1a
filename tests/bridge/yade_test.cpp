#include <gtest/gtest.h>

#include "../material_points_contract.hpp"
#include "python_volume_elements.hpp"

namespace femxdem {
namespace {

using contract::expect_same_bits;
using contract::gradients;
using contract::part;

constexpr const char* kSpecification = R"({"source": "prepare", "spheres": 64, "seed": 3, "size_ratio": 1.5,
  "kappa": 500.0, "stiffness_ratio": 1.0, "friction": 0.5, "compaction_friction": 0.0, "cohesion": 0.0,
  "contact_law": "adhesive", "new_contacts": "frictional", "confining_stress": 1e5, "mean_diameter": 1e-3,
  "density": 2600.0, "damping": 0.2, "time_step_safety": 0.8})";

/// Packing of 64 spheres, prepared once for all tests.
const std::string& packing() {
  static const std::string state = [] {
    WorkerProcess worker({});
    return PythonVolumeElements(worker, {}).make_template(kSpecification).state;
  }();
  return state;
}

struct Cells {
  explicit Cells(std::size_t count, VolumeElementOptions options = {})
      : worker({}), points(worker, std::move(options)) {
    points.add(packing(), count);
  }
  WorkerProcess worker;
  PythonVolumeElements points;
};

/// Noise of a granular cell: a path in two trials passes one step more or less than the same path in one. The rate is
/// the same only where min_steps does not bind.
contract::Tolerances tolerances() { return {.strain = 2e-4, .path = 2e-3, .rotation = 1e-10}; }

TEST(YadeVolumeElements, ContractWithFork) {
  VolumeElementOptions options;
  options.min_steps = 1;
  Cells cells(3, options);
  contract::check(cells.points, tolerances());
}

TEST(YadeVolumeElements, ContractWithSerialising) {
  VolumeElementOptions options;
  options.serialise = true;
  options.min_steps = 1;
  Cells cells(3, options);
  contract::check(cells.points, tolerances());
}

/// To the bit where the committed state was itself just restored, to 1e-10 on a path of commits.
TEST(YadeVolumeElements, ForkAgainstSerialising) {
  VolumeElementOptions options;
  options.serialise = true;
  Cells forked(3), saved(3, options);
  const auto F = gradients(3, 1e-3);
  for (const double fraction : {0.25, 0.5, 0.75, 1.0}) {
    const auto a = contract::trial(forked.points, part(F, fraction));
    const auto b = contract::trial(saved.points, part(F, fraction));
    if (fraction == 0.25) expect_same_bits(a, b);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_LE((a[i].stress - b[i].stress).norm(), 1e-10 * a[i].stress.norm());
    forked.points.commit();
    saved.points.commit();
  }
  saved.points.load(forked.points.save());
  expect_same_bits(contract::trial(forked.points, part(F, 1.1)), contract::trial(saved.points, part(F, 1.1)));
}

/// A volume element answers the same in whatever company it lives: what makes results independent of the ranks.
TEST(YadeVolumeElements, CompanyDoesNotMatter) {
  Cells three(3), one(1);
  const auto F = gradients(3, 5e-4);
  for (const double fraction : {0.5, 1.0}) {
    const auto a = contract::trial(three.points, part(F, fraction));
    const auto b = contract::trial(one.points, {part(F, fraction)[0]});
    EXPECT_TRUE(contract::same_bits(a[0].stress, b[0].stress));
    three.points.commit();
    one.points.commit();
  }
}

}  // namespace
}  // namespace femxdem
