#include "warnings.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "preset.hpp"

namespace femxdem {
namespace {

bool says(const std::vector<std::string>& sentences, const std::string& part) {
  for (const std::string& s : sentences) {
    if (s.find(part) != std::string::npos) return true;
  }
  return false;
}

/// Biaxial in a von Mises law that softens by 40 Pa from 6 Pa (E = 1000 Pa), second gradient with D [N].
Case softening_case(double D) {
  Case c;
  c.element.type = ElementType::second_gradient;
  c.element.D = D;
  c.material.type = MaterialType::von_mises;
  c.material.young = 1000;
  c.material.yield_stress = 6;
  c.material.hardening = -40;
  c.material.residual_stress = 2;
  for (const char* edge : {"bottom", "top"}) {
    Load load;
    load.edge = edge;
    load.component = Component::y;
    load.value = 0;
    c.loads.push_back(load);
  }
  return c;
}

/// Von Mises in pure shear: d tau / d gamma = G h / (G + h) with h = hardening / 3, so |a| = 400 * 13.33 / 386.67
/// = 13.79.
TEST(Warnings, SofteningModulusOfVonMisesIsThatOfShear) {
  const BandModuli moduli = band_moduli(VonMisesLaw{1000, 0.25, 6, -40, 2, 0});
  EXPECT_NEAR(moduli.elastic, 400, 4);
  EXPECT_NEAR(moduli.softening, 400 * (40.0 / 3) / (400 - 40.0 / 3), 0.3);
  EXPECT_EQ(band_moduli(VonMisesLaw{1000, 0.25, 6, 40, 0, 0}).softening, 0);
  EXPECT_EQ(band_moduli(ElasticLaw{1000, 0.25, 0}).softening, 0);
  EXPECT_EQ(band_moduli(BilinearLaw{100, -10, 0.01, 0, 0}).softening, 10);
}

TEST(Warnings, ExpectedBandIsThatOfTheSofteningBar) {
  // A1 = 100, A2 = -10, D = 0.04: w = 0.3586 (bar of length 1, where tanh is 1 to 1e-13)
  EXPECT_NEAR(expected_band_width(0.04, {10, 100}), 0.35864, 1e-5);
  EXPECT_NEAR(expected_band_width(0.16, {10, 100}) / expected_band_width(0.04, {10, 100}), 2, 1e-14);
  EXPECT_NEAR(band_modulus(one_parameter_law(7)), 7, 1e-14);
}

TEST(Warnings, CoarseMeshIsSaidWithTheNumbers) {
  const Mesh mesh = rectangle_mesh(1, 2, 8, 16);
  const double width = expected_band_width(0.05, band_moduli(VonMisesLaw{1000, 0.25, 6, -40, 2, 0}));
  ASSERT_LT(width, 0.5);  // 4 elements of 1/8
  const auto coarse = warnings(softening_case(0.05), mesh);
  EXPECT_TRUE(says(coarse, "the expected band is 0.3")) << coarse.front();
  EXPECT_TRUE(says(coarse, "elements of 0.125 m"));
  EXPECT_FALSE(says(warnings(softening_case(0.05), rectangle_mesh(1, 2, 16, 32)), "expected band"));
  EXPECT_FALSE(says(warnings(softening_case(0.5), mesh), "expected band"));
}

/// w = 2 sqrt(4e3 N / 1.4e5 Pa) (pi - atan sqrt(1.4 / 500)) = 1.044 m.
TEST(Warnings, APresetSaysItsErrorsAndItsMesh) {
  Case c = softening_case(4e3);
  c.material.type = MaterialType::volume_element;
  const Mesh mesh = rectangle_mesh(1, 2, 4, 8);
  EXPECT_EQ(preset_advice(c, mesh), "");
  c.ve.preset = VePreset::fast;
  const std::string advice = preset_advice(c, mesh);
  EXPECT_NE(advice.find(fmt::format("preset fast: erred by {:.0f} % at the peak", 100 * preset(VePreset::fast).peak)),
            std::string::npos)
      << advice;
  EXPECT_NE(advice.find("elements of at most 0.26 m, 4 across the expected band (these: 0.25 m)"), std::string::npos)
      << advice;
  c.element.type = ElementType::q8;
  EXPECT_NE(preset_advice(c, mesh).find("no mesh is fine enough"), std::string::npos);
}

TEST(Warnings, IdenticalPointsThatSoftenAreSaid) {
  const Mesh mesh = rectangle_mesh(1, 2, 8, 16);
  Case c = softening_case(0.5);
  EXPECT_TRUE(says(warnings(c, mesh), "all points are identical"));
  Case weak = c;
  weak.material_regions.push_back({"weak", c.material});
  EXPECT_FALSE(says(warnings(weak, mesh), "identical"));
  Case random = c;
  random.solver.start_amplitude = 1e-3;
  EXPECT_FALSE(says(warnings(random, mesh), "identical"));
  Case hardening = c;
  hardening.material.hardening = 40;
  EXPECT_FALSE(says(warnings(hardening, mesh), "identical"));
  Case grains = c;
  grains.material.type = MaterialType::volume_element;
  EXPECT_TRUE(says(warnings(grains, mesh), "[[ve.region]]"));
}

TEST(Warnings, UndeterminedMultiplierIsSaid) {
  const Mesh mesh = rectangle_mesh(1, 1, 4, 4);
  Case c = softening_case(5);
  c.loads.clear();
  const auto prescribe = [&](LoadKind kind, Component component) {
    for (const char* edge : {"bottom", "right", "top", "left"}) {
      Load load;
      load.edge = edge;
      load.kind = kind;
      load.component = component;
      c.loads.push_back(load);
    }
  };
  for (const Component component : {Component::x, Component::y}) prescribe(LoadKind::displacement, component);
  for (const Component component : {Component::xx, Component::xy, Component::yx}) {
    prescribe(LoadKind::gradient, component);
  }
  EXPECT_FALSE(says(warnings(c, mesh), "undetermined"));
  prescribe(LoadKind::gradient, Component::yy);
  EXPECT_TRUE(says(warnings(c, mesh), "undetermined"));
}

TEST(Warnings, SlowTrialsThatAnswerWithTheirEnd) {
  Case c = softening_case(0.05);
  c.material.type = MaterialType::volume_element;
  const Mesh mesh = rectangle_mesh(1, 2, 8, 16);
  c.ve.inertial_number = 1e-2;
  EXPECT_FALSE(says(warnings(c, mesh), "rough function"));
  c.ve.inertial_number = 2e-3;
  EXPECT_TRUE(says(warnings(c, mesh), "leave ve.answer"));
  c.ve.answer = VeAnswer::mean;
  EXPECT_FALSE(says(warnings(c, mesh), "rough function"));
}

}  // namespace
}  // namespace femxdem
