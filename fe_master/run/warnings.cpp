#include "warnings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "localisation.hpp"
#include "preset.hpp"

namespace femxdem {
namespace {

constexpr double kElementsForForce = 4, kElementsForWidth = 14;  // across the band, on the bilinear bar
constexpr double kVeSoftening = 1.4;                             // |a| / sigma_0

/// The most negative eigenvalue over the directions, and the elastic modulus along its eigenvector.
BandModuli least_moduli(const Tensor4& tangent, const Tensor4& elastic) {
  BandModuli moduli;
  for (int direction = 0; direction < 180; ++direction) {
    const double angle = direction * std::numbers::pi / 180;
    const Eigen::Vector2d n(std::cos(angle), std::sin(angle));
    const Eigen::Matrix2d A = acoustic_tensor(tangent, n);
    const double half = 0.5 * A.trace(), root = half * half - A.determinant();
    if (root < 0) continue;  // complex
    const double least = half - std::sqrt(root);
    if (least >= -moduli.softening) continue;
    // (A - l) g = 0: g is normal to the longer row of A - l.
    const Eigen::Matrix2d rest = A - least * Eigen::Matrix2d::Identity();
    const Eigen::RowVector2d row = rest.row(rest.row(0).norm() >= rest.row(1).norm() ? 0 : 1);
    const Eigen::Vector2d g = Eigen::Vector2d(-row[1], row[0]).normalized();
    moduli = {-least, g.dot(acoustic_tensor(elastic, n) * g)};
  }
  return moduli;
}

/// Compression along x2 by one more strain step, F11 found for the lateral stress; false when it cannot go on.
bool compress(const AnalyticLaw& law, double lateral, Tensor2& F, LawState& state, Response& response) {
  constexpr double kStep = 2e-4;
  LawState trial;
  F(1, 1) -= kStep;
  for (int iteration = 0; iteration < 30; ++iteration) {
    response = update(law, state, F, Operator::tangent, trial);
    if (response.failure) return false;
    const double off = response.stress(0, 0) - lateral;
    if (std::abs(off) < 1e-9 * (response.stress.norm() + std::abs(lateral))) {
      state = trial;
      return true;
    }
    F(0, 0) *= 1 - off / response.stiffness(0, 0);
  }
  return false;
}

/// Largest softening modulus between the first yield and a further 5 % of strain: in plane strain localisation waits
/// for the stress along x3 to follow.
BandModuli moduli_along_compression(const AnalyticLaw& law, const Tensor4& elastic) {
  constexpr int kElastic = 2000, kPlastic = 250, kEvery = 10;
  LawState state = initial_state(law);
  const double lateral = state.stress(0, 0);
  Tensor2 F = Tensor2::Identity();
  Response response;
  BandModuli largest;
  int plastic = 0;
  for (int step = 0; step < kElastic && plastic < kPlastic; ++step) {
    if (!compress(law, lateral, F, state, response)) break;
    if (state.softening_strain == 0 || ++plastic % kEvery != 0) continue;
    const BandModuli moduli = least_moduli(response.stiffness, elastic);
    if (moduli.softening > largest.softening) largest = moduli;
  }
  return largest;
}

double element_size(const Mesh& mesh) {
  double area = 0;
  for (const auto& nodes : mesh.elements) {
    const Point2 a = mesh.nodes[nodes[2]] - mesh.nodes[nodes[0]], b = mesh.nodes[nodes[3]] - mesh.nodes[nodes[1]];
    area += 0.5 * std::abs(a.x() * b.y() - a.y() * b.x());
  }
  return std::sqrt(area / static_cast<double>(mesh.elements.size()));
}

BandModuli moduli_of(const Case& c) {
  return on_volume_elements(c) ? band_moduli(c.ve) : band_moduli(make_law(c.material));
}

void warn_of_coarse_mesh(const Case& c, const Mesh& mesh, const BandModuli& moduli, std::vector<std::string>& out) {
  if (c.element.type != ElementType::second_gradient || moduli.softening == 0) return;
  const double D = band_modulus(make_double_stiffness(c.element)), size = element_size(mesh);
  const double width = expected_band_width(D, moduli);
  if (width >= kElementsForForce * size) return;
  out.push_back(fmt::format(
      "the expected band is {:.3g} m wide (D = {:.3g} N, softening modulus |a| = {:.3g} Pa{}): {:.1f} elements of "
      "{:.3g} "
      "m, but {:g} are needed for the force and {:g} for the width; take elements of {:.3g} m or D = {:.3g} N",
      width, D, moduli.softening,
      on_volume_elements(c) ? ", 1.4 sigma_0 as in earlier runs" : " in plane-strain compression", width / size, size,
      kElementsForForce, kElementsForWidth, width / kElementsForForce,
      D * std::pow(kElementsForForce * size / width, 2)));
}

bool has_imperfection(const Case& c) {
  const bool pool = c.ve.assignment == Assignment::random && c.ve.seeds.size() > 1;
  const bool regions = on_volume_elements(c) ? !c.ve_regions.empty() || pool : !c.material_regions.empty();
  return regions || c.solver.start_amplitude > 0 || c.body_force.x != 0 || c.body_force.y != 0;
}

/// An edge whose nodes can neither slide nor part strains the body unevenly.
bool has_rough_edge(const Case& c) {
  return std::any_of(c.loads.begin(), c.loads.end(), [&](const Load& a) {
    return a.component == Component::x && !a.edge.empty() &&
           (a.kind == LoadKind::displacement || a.kind == LoadKind::velocity) &&
           std::any_of(c.loads.begin(), c.loads.end(), [&](const Load& b) {
             return b.edge == a.edge && b.component == Component::y &&
                    (b.kind == LoadKind::displacement || b.kind == LoadKind::velocity);
           });
  });
}

void warn_of_identical_points(const Case& c, const BandModuli& moduli, std::vector<std::string>& out) {
  if (moduli.softening == 0 || has_imperfection(c) || has_rough_edge(c) || c.mesh.type == MeshType::annulus) return;
  out.push_back(fmt::format(
      "all points are identical and nothing makes the strain uneven, but the material softens (|a| = {:.3g} Pa): the "
      "solution stays homogeneous beyond the bifurcation, or leaves it by round-off; weaken a region ([[{}.region]]) "
      "or "
      "set solver.start_amplitude",
      moduli.softening, on_volume_elements(c) ? "ve" : "material"));
}

void warn_of_rough_answers(const Case& c, std::vector<std::string>& out) {
  if (!on_volume_elements(c) || c.ve.answer == VeAnswer::mean || c.ve.inertial_number > kSlowTrial) return;
  out.push_back(fmt::format(
      "at ve.inertial_number = {:g} the stress of a trial's end is a rough function of its strain: up to three times "
      "the evaluations, and rejected steps; leave ve.answer, solver.reuse_below and ve.hold_steps at their defaults",
      c.ve.inertial_number));
}

/// Components (x, y, 11, 12, 21, 22) that a case prescribes on an edge.
std::size_t prescribed_components(const Case& c, const std::string& edge) {
  std::set<std::pair<bool, Component>> components;
  for (const Load& load : c.loads) {
    if (load.edge != edge || load.kind == LoadKind::traction || load.kind == LoadKind::pressure) continue;
    components.insert({load.kind == LoadKind::gradient, load.component});
  }
  return components.size();
}

void warn_of_multiplier(const Case& c, const Mesh& mesh, std::vector<std::string>& out) {
  if (c.element.type != ElementType::second_gradient) return;
  const bool all = std::all_of(mesh.edges.begin(), mesh.edges.end(),
                               [&](const auto& edge) { return prescribed_components(c, edge.first) == 6; });
  if (!all || mesh.edges.empty()) return;
  out.push_back(
      fmt::format("u and all four components of v are prescribed on all {} edges: on a regular mesh four striped modes "
                  "of lambda are undetermined; u, v and the stresses are not touched, but do not read lambda",
                  mesh.edges.size()));
}

}  // namespace

BandModuli band_moduli(const AnalyticLaw& law) {
  if (const auto* bar = std::get_if<BilinearLaw>(&law)) {
    return bar->A2 < 0 ? BandModuli{-bar->A2, bar->A1} : BandModuli{};
  }
  LawState trial;
  const Tensor4 elastic = update(law, initial_state(law), Tensor2::Identity(), Operator::elastic, trial).stiffness;
  const bool yields = std::holds_alternative<VonMisesLaw>(law) || std::holds_alternative<DruckerPragerLaw>(law);
  return yields ? moduli_along_compression(law, elastic) : BandModuli{};
}

BandModuli band_moduli(const VeParameters& ve) {
  return {kVeSoftening * ve.confining_stress, 0.5 * ve.kappa * ve.confining_stress};
}

double expected_band_width(double D, const BandModuli& moduli) {
  const double ratio = std::sqrt(moduli.softening / moduli.elastic);
  return 2 * std::sqrt(D / moduli.softening) * (std::numbers::pi - std::atan(ratio));
}

double band_modulus(const DoubleStiffness& law) {
  Eigen::Matrix2d A;
  A << law(0, 0), law(0, 4), law(4, 0), law(4, 4);
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(A).eigenvalues().minCoeff();
}

std::vector<std::string> warnings(const Case& c, const Mesh& mesh) {
  std::vector<std::string> out;
  const BandModuli moduli = moduli_of(c);
  warn_of_coarse_mesh(c, mesh, moduli, out);
  warn_of_identical_points(c, moduli, out);
  warn_of_multiplier(c, mesh, out);
  warn_of_rough_answers(c, out);
  return out;
}

std::string preset_advice(const Case& c, const Mesh& mesh) {
  if (c.ve.preset == VePreset::none || !on_volume_elements(c)) return "";
  const Preset& p = preset(c.ve.preset);
  std::string advice =
      "beyond the peak a band is one element wide: no mesh is fine enough, element.type = \"second_gradient\" is";
  if (c.element.type == ElementType::second_gradient) {
    const double width = expected_band_width(band_modulus(make_double_stiffness(c.element)), band_moduli(c.ve));
    advice = fmt::format("elements of at most {:.2g} m, {} across the expected band (these: {:.2g} m)",
                         width / p.elements_across, p.elements_across, element_size(mesh));
  }
  return fmt::format(
      "preset {}: erred by {:.0f} % at the peak, {:.0f} % in the residual, {:.0f} % in the band and {:.0f} % along the "
      "curve of a biaxial test (validation/speed_accuracy); mesh: {}",
      p.name, 100 * p.peak, 100 * p.residual, 100 * p.band, 100 * p.curve, advice);
}

}  // namespace femxdem
