#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "compact_block.hpp"
#include "compact_cell.hpp"
#include "compact_step.hpp"

/// The paper's law between two spheres against its closed form, by every kernel of this processor.
namespace femxdem {
namespace {

constexpr double kDiameter = 1.0, kKn = 5e4, kAdhesion = 0.1, kFriction = 0.5;  // [m], [N/m], [N], [-]
constexpr double kStep = 0.05 * kAdhesion / kKn;                                // [m]
constexpr double kTime = 1e-6;                                                  // of a step [s]
constexpr double kMass = 1e3;  // [kg]: what the forces do to the velocities in a step is below round-off of a path

/// A sphere at the origin, where it stays but for round-off, and one beyond it on the x axis that goes where it is
/// told.
struct Pair {
  explicit Pair(double overlap, double viscous_damping = 0, double new_adhesion = 0) : block(header(viscous_damping)) {
    const CompactArrays& a = block.arrays();
    for (std::size_t s = 0; s < 2; ++s) {
      a.spheres[s].radius = kDiameter / 2;
      a.mass[s] = kMass, a.inertia[s] = kMass, a.turned[0][s] = 1, a.tangent[s] = kFriction;
    }
    a.spheres[1].x[0] = kDiameter - overlap;
    a.classes[0] = {.normal_adhesion = kAdhesion, .shear_adhesion = kFriction * kAdhesion, .tangent = kFriction};
    a.classes[1] = {.normal_adhesion = new_adhesion, .tangent = kFriction, .when_broken = 1, .for_new = 1};
    a.j[0] = 1;
    a.kn[0] = a.ks[0] = kKn;
    a.normal[0][0] = 1;
    a.header->contacts = 1;
    make_list(block);
    find_forces(block);
  }

  static CompactHeader header(double viscous_damping) {
    CompactHeader h;
    h.law = CompactLaw::paper;
    h.spheres = 2, h.classes = 2, h.contact_capacity = 8;
    h.time_step = kTime;
    h.H = h.trsf = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    for (double& entry : h.H) entry *= 10 * kDiameter;
    h.max_radius = h.min_radius = kDiameter / 2;
    h.constant_kn = h.constant_ks = kKn;
    h.density = h.mean_diameter = h.solid_volume = 1;
    h.viscous_damping = viscous_damping;
    return h;
  }

  /// The sphere goes further by these numbers of steps, closing the contact and along it.
  void go(double closing, double along) {
    const CompactArrays& a = block.arrays();
    a.spheres[0].v = a.spheres[0].w = a.spheres[1].w = {};
    a.spheres[1].v = {-closing * kStep / kTime, along * kStep / kTime, 0};
    step(block);
  }
  double overlap() const {
    const auto& x = block.arrays().spheres[1].x;
    return kDiameter - std::hypot(x[0], x[1]);
  }
  double normal_force() const {  // compression positive
    const auto &f = block.arrays().spheres[1].f, &x = block.arrays().spheres[1].x;
    return (f[0] * x[0] + f[1] * x[1]) / std::hypot(x[0], x[1]);
  }
  double shear_force() const {  // against the sphere's way
    const auto &f = block.arrays().spheres[1].f, &x = block.arrays().spheres[1].x;
    return (f[0] * x[1] - f[1] * x[0]) / std::hypot(x[0], x[1]);
  }
  double closing_rate() const {  // [m/s]
    const auto &v = block.arrays().spheres[1].v, &x = block.arrays().spheres[1].x;
    return -(v[0] * x[0] + v[1] * x[1]) / std::hypot(x[0], x[1]);
  }
  bool contact() const { return block.header().contacts == 1; }

  CompactBlock block;
};

class PaperLaw : public testing::TestWithParam<Kernel> {
 protected:
  void SetUp() override { use_kernel(GetParam()); }
  void TearDown() override { use_kernel(kernels().back()); }
};

TEST_P(PaperLaw, OpenedUntilTheOverlapEndsAndClosedAgain) {
  for (const double later : {0.0, kAdhesion}) {
    Pair pair(40.3 * kStep, 0, later);
    double adhesion = kAdhesion;
    for (int k = 0; k < 160; ++k) {
      pair.go(k < 80 ? -1 : 1, 0);
      const double overlap = pair.overlap();
      ASSERT_EQ(pair.contact(), overlap >= 0) << "step " << k;
      ASSERT_NEAR(pair.normal_force(), overlap >= 0 ? kKn * overlap - adhesion : 0, 1e-7 * kAdhesion) << "step " << k;
      ASSERT_NEAR(pair.shear_force(), 0, 1e-7 * kAdhesion);
      if (overlap < 0) adhesion = later;
    }
    EXPECT_NEAR(pair.normal_force(), kKn * pair.overlap() - later, 1e-7 * kAdhesion);
  }
}

/// At 1.3 f_c/kn it is compressed, at 0.3 attracted; YADE's adhesive law passes no normal force while the latter
/// slides.
TEST_P(PaperLaw, SlidesAtItsLimitAndKeepsItsNormalForce) {
  for (const double overlap : {26 * kStep, 6 * kStep}) {
    Pair pair(overlap);
    const int there = static_cast<int>(3 * kFriction * overlap / kStep);
    double shear = 0, work = 0, slipped = 0;
    for (int k = 0; k < 4 * there; ++k) {
      const double way = k < there || k >= 3 * there ? 1 : -1, before = pair.shear_force();
      pair.go(0, way);
      const double limit = kFriction * kKn * pair.overlap();
      const double trial = shear + kKn * way * kStep * kDiameter / (kDiameter - pair.overlap());
      shear = std::clamp(trial, -limit, limit);
      slipped += std::abs(trial - shear) / kKn;
      work += 0.5 * (before + pair.shear_force()) * way * kStep;
      ASSERT_NEAR(pair.shear_force(), shear, 1e-7 * kAdhesion) << "step " << k;
      ASSERT_NEAR(pair.normal_force(), kKn * pair.overlap() - kAdhesion, 1e-7 * kAdhesion) << "step " << k;
    }
    const double limit = kFriction * kKn * overlap;
    EXPECT_NEAR(work, limit * slipped + 0.5 * limit * limit / kKn, 3 * limit * kStep) << "dissipated and stored";
    EXPECT_GT(slipped, overlap);
  }
}

/// The normal force depends on the overlap alone: a closed path under sliding gives back what it took.
TEST_P(PaperLaw, NormalForceMakesNoEnergyWhileItSlides) {
  Pair pair(10.3 * kStep);
  double work = 0, largest = 0;
  for (int k = 0; k < 40; ++k) {
    const double before = pair.normal_force(), overlap = pair.overlap();
    pair.go(k < 10 || k >= 30 ? 1 : -1, k < 20 ? 2 : -2);
    work += 0.5 * (before + pair.normal_force()) * (pair.overlap() - overlap);
    largest = std::max(largest, std::abs(work));
  }
  EXPECT_GT(largest, 2 * kAdhesion * kStep);
  EXPECT_NEAR(work, 0, 1e-4 * largest);
}

TEST_P(PaperLaw, DashpotAddsToTheRepulsionAndNeverAttracts) {
  const double ratio = 0.3, c = 2 * ratio * std::sqrt(kKn * kMass / 2);
  Pair pair(20.3 * kStep, ratio);
  double shear = 0;
  for (const auto& [closing, along] : std::initializer_list<std::pair<double, double>>{
           {1e-3, 0.1}, {-1e-3, 0.2}, {0, 0.1}, {5e-4, 30}, {-1e-3, 0}, {-1, 0}, {0, 0.1}}) {
    pair.go(closing, along);
    const double elastic = kKn * pair.overlap(), repulsion = std::max(0.0, elastic + c * pair.closing_rate());
    shear = std::min(shear + kKn * along * kStep, kFriction * repulsion);
    EXPECT_NEAR(pair.normal_force(), repulsion - kAdhesion, 1e-4 * kAdhesion) << closing;
    EXPECT_NEAR(pair.shear_force(), shear, 1e-4 * kAdhesion) << closing;
  }
  pair.go(1e-3, 0);
  rest(pair.block);
  EXPECT_NEAR(pair.normal_force(), kKn * pair.overlap() - kAdhesion, 1e-7 * kAdhesion) << "at rest no dashpot acts";
  const std::string rested = pair.block.save();
  rest(pair.block);
  EXPECT_EQ(pair.block.save(), rested);
}

TEST_P(PaperLaw, AHoldCountsItsStepsAndDeformsNothing) {
  CompactCell cell = CompactCell::load(Pair(20.3 * kStep).block.save());
  EXPECT_FALSE(cell.law_of_yade());
  ASSERT_FALSE(cell.deform({1e-3, 0, 0, 0, -1e-3, 0, 0, 0, 0}, 5).failure);
  const auto stretch = cell.stretch();
  const double inertial = cell.trial_report()["inertial_number"];
  ASSERT_FALSE(cell.hold(7));
  EXPECT_EQ(cell.stretch(), stretch);
  EXPECT_EQ(cell.trial_report()["dem_steps"], 12);
  EXPECT_NEAR(cell.trial_report()["inertial_number"], inertial, 1e-6 * inertial);
}

TEST_P(PaperLaw, EveryKernelGivesTheBitsOfTheFirst) {
  const auto saved = [] {
    Pair pair(5.3 * kStep, 0.2, kAdhesion);
    for (int k = 0; k < 60; ++k) pair.go(k % 17 < 9 ? -1 : 1.1, 0.3 * (k % 7) - 0.5);
    return pair.block.save();
  };
  const std::string mine = saved();
  use_kernel(kernels().front());
  EXPECT_EQ(mine, saved());
}

INSTANTIATE_TEST_SUITE_P(Kernels, PaperLaw, testing::ValuesIn(kernels()));

}  // namespace
}  // namespace femxdem
