#include "mesh.hpp"

#include <gmsh.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <numbers>
#include <set>

#include "errors.hpp"
#include "mesh_measures.hpp"
#include "reference_element.hpp"

namespace femxdem {
namespace {

constexpr double kPi = std::numbers::pi;

/// Sides of an edge chain up, are sides of their elements, and have the material on the left.
void expect_oriented_chain(const Mesh& mesh, const std::string& name) {
  const auto& sides = mesh.edges.at(name);
  for (std::size_t s = 0; s < sides.size(); ++s) {
    if (s > 0) {
      EXPECT_EQ(sides[s].nodes[0], sides[s - 1].nodes[2]) << name << " side " << s;
    }
    const auto& e = mesh.elements.at(sides[s].element);
    bool found = false;
    for (int k = 0; k < 4; ++k) found |= sides[s].nodes == std::array<int, 3>{e[k], e[4 + k], e[(k + 1) % 4]};
    EXPECT_TRUE(found) << name << " side " << s;
    const Point2 along = mesh.nodes[sides[s].nodes[2]] - mesh.nodes[sides[s].nodes[0]];
    const Point2 inward = element_centre(mesh, sides[s].element) - mesh.nodes[sides[s].nodes[1]];
    EXPECT_GT(along.x() * inward.y() - along.y() * inward.x(), 0.0) << name << " side " << s;
  }
}

/// Integral of x n ds over all named edges of a closed boundary: 2 x area.
double twice_area_by_edges(const Mesh& mesh) {
  double sum = 0.0;
  for (const auto& [name, sides] : mesh.edges) {
    for (const Side& side : sides) {
      for (const EdgePoint& p : gauss_edge()) {
        const Eigen::Vector3d N = shape_edge(p.s), dN = shape_gradient_edge(p.s);
        Point2 x = Point2::Zero(), t = Point2::Zero();
        for (int a = 0; a < 3; ++a) {
          x += N[a] * mesh.nodes[side.nodes[a]];
          t += dN[a] * mesh.nodes[side.nodes[a]];
        }
        sum += p.weight * (x.x() * t.y() - x.y() * t.x());
      }
    }
  }
  return sum;
}

std::vector<std::string> edge_names(const Mesh& mesh) {
  std::vector<std::string> names;
  for (const auto& [name, sides] : mesh.edges) names.push_back(name);
  return names;
}

TEST(RectangleMesh, CountsAreaAndEdges) {
  const Mesh mesh = rectangle_mesh(1.5, 2.0, 3, 5);
  EXPECT_EQ(mesh.elements.size(), 15u);
  EXPECT_EQ(mesh.nodes.size(), 4u * 6 + 3 * 6 + 4 * 5);
  EXPECT_NEAR(area(mesh), 3.0, 1e-14);
  EXPECT_NEAR(twice_area_by_edges(mesh), 6.0, 1e-14);
  EXPECT_EQ(edge_names(mesh), (std::vector<std::string>{"bottom", "left", "right", "top"}));
  EXPECT_EQ(mesh.edges.at("top").size(), 3u);
  EXPECT_EQ(mesh.edges.at("left").size(), 5u);
  EXPECT_NEAR(edge_length(mesh, "top"), 1.5, 1e-15);
  EXPECT_NEAR(edge_length(mesh, "right"), 2.0, 1e-15);
  for (const std::string& name : edge_names(mesh)) expect_oriented_chain(mesh, name);
  for (const Side& side : mesh.edges.at("right")) EXPECT_EQ(mesh.nodes[side.nodes[1]].x(), 1.5);
  for (const Side& side : mesh.edges.at("bottom")) EXPECT_EQ(mesh.nodes[side.nodes[1]].y(), 0.0);
  check_mesh(mesh);
}

TEST(AnnulusMesh, QuarterHasItsEdgesOnTheAxes) {
  const Mesh mesh = annulus_mesh(1.0, 3.0, 90.0, 4, 6);
  EXPECT_EQ(mesh.elements.size(), 24u);
  EXPECT_EQ(mesh.nodes.size(), 5u * 7 + 4 * 7 + 5 * 6);
  for (const std::string& name : edge_names(mesh)) expect_oriented_chain(mesh, name);
  for (const Side& side : mesh.edges.at("start")) EXPECT_EQ(mesh.nodes[side.nodes[1]].y(), 0.0);
  for (const Side& side : mesh.edges.at("end")) EXPECT_EQ(mesh.nodes[side.nodes[1]].x(), 0.0);
  for (const Side& side : mesh.edges.at("inner")) EXPECT_NEAR(mesh.nodes[side.nodes[1]].norm(), 1.0, 1e-15);
  for (const Side& side : mesh.edges.at("outer")) EXPECT_NEAR(mesh.nodes[side.nodes[1]].norm(), 3.0, 1e-15);
  EXPECT_NEAR(twice_area_by_edges(mesh), 2.0 * area(mesh), 1e-13);
  check_mesh(mesh);
}

TEST(AnnulusMesh, AreaAndArcsConvergeAtOrderFour) {
  const auto error = [](int nt) { return std::abs(area(annulus_mesh(1.0, 3.0, 90.0, 2, nt)) - 2.0 * kPi); };
  const auto arc = [](int nt) {
    return std::abs(edge_length(annulus_mesh(1.0, 3.0, 90.0, 2, nt), "outer") - 1.5 * kPi);
  };
  EXPECT_NEAR(std::log2(error(4) / error(8)), 4.0, 0.1);
  EXPECT_NEAR(std::log2(arc(4) / arc(8)), 4.0, 0.1);
  EXPECT_LT(error(8), 1e-4);
}

TEST(AnnulusMesh, FullRingIsClosed) {
  const Mesh mesh = annulus_mesh(1.0, 2.0, 360.0, 2, 16);
  EXPECT_EQ(edge_names(mesh), (std::vector<std::string>{"inner", "outer"}));
  EXPECT_EQ(mesh.nodes.size(), 3u * 16 + 2 * 16 + 3 * 16);
  for (const std::string& name : edge_names(mesh)) {
    expect_oriented_chain(mesh, name);
    EXPECT_EQ(mesh.edges.at(name).back().nodes[2], mesh.edges.at(name).front().nodes[0]);
  }
  EXPECT_NEAR(area(mesh), 3.0 * kPi, 1e-3);
}

TEST(Distortion, MovesInteriorCornersOnly) {
  const Mesh regular = rectangle_mesh(1.0, 2.0, 4, 8);
  Mesh mesh = regular, again = regular, other = regular;
  distort(mesh, 0.3, 5);
  distort(again, 0.3, 5);
  distort(other, 0.3, 6);
  double largest = 0.0;
  bool same_as_other = true;
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n) {
    const Point2& x = regular.nodes[n];
    const bool boundary = x.x() == 0.0 || x.x() == 1.0 || x.y() == 0.0 || x.y() == 2.0;
    const double shift = (mesh.nodes[n] - x).norm();
    largest = std::max(largest, shift);
    if (boundary) {
      EXPECT_EQ(shift, 0.0);
    }
    EXPECT_EQ(mesh.nodes[n], again.nodes[n]);
    same_as_other &= mesh.nodes[n] == other.nodes[n];
  }
  EXPECT_GT(largest, 0.1 * 0.25);
  EXPECT_LE(largest, 0.3 * 0.25);
  EXPECT_FALSE(same_as_other);
  for (const auto& e : mesh.elements) {
    for (int k = 0; k < 4; ++k)
      EXPECT_NEAR((0.5 * (mesh.nodes[e[k]] + mesh.nodes[e[(k + 1) % 4]]) - mesh.nodes[e[4 + k]]).norm(), 0.0, 1e-15);
  }
  EXPECT_NEAR(area(mesh), 2.0, 1e-14);
  check_mesh(mesh);
}

TEST(CheckMesh, NamesTheFoldedElement) {
  Mesh mesh = rectangle_mesh(1.0, 1.0, 2, 2);
  mesh.nodes[mesh.elements[3][2]] = {0.4, 0.4};
  try {
    check_mesh(mesh);
    FAIL() << "the folded element was not seen";
  } catch (const UserError& error) {
    EXPECT_EQ(std::string(error.what()).rfind("element 3 at ", 0), 0u) << error.what();
  }
}

std::string case_file(const std::string& name) { return std::string(TEST_CASES) + "/" + name; }

TEST(GmshMesh, GeometryIsMeshedWithItsNames) {
  const Mesh mesh = gmsh_mesh(case_file("square.geo"));
  EXPECT_EQ(mesh.elements.size(), 4u);
  EXPECT_EQ(mesh.nodes.size(), 21u);
  EXPECT_NEAR(area(mesh), 1.0, 1e-14);
  EXPECT_EQ(edge_names(mesh), (std::vector<std::string>{"bottom", "left", "right", "top"}));
  EXPECT_EQ(mesh.regions.at("soil"), (std::vector<int>{0, 1, 2, 3}));
  for (const std::string& name : edge_names(mesh)) {
    expect_oriented_chain(mesh, name);
    EXPECT_EQ(mesh.edges.at(name).size(), 2u);
    EXPECT_NEAR(edge_length(mesh, name), 1.0, 1e-15);
  }
  check_mesh(mesh);
}

/// An unstructured mesh of a plate, two named surfaces, written by Gmsh; the right half is meshed clockwise.
std::string two_surfaces() {
  const std::string file = (std::filesystem::path(testing::TempDir()) / "plate.msh").string();
  gmsh::initialize(0, nullptr, false);
  gmsh::option::setNumber("General.Terminal", 0);
  gmsh::option::setNumber("Mesh.ElementOrder", 2);
  gmsh::option::setNumber("Mesh.SecondOrderIncomplete", 1);
  gmsh::option::setNumber("Mesh.RecombineAll", 1);
  gmsh::option::setNumber("Mesh.RecombinationAlgorithm", 3);
  gmsh::option::setNumber("Mesh.MeshSizeMax", 0.25);
  namespace geo = gmsh::model::geo;
  const std::vector<std::array<double, 2>> corners = {{0, 0}, {1, 0}, {2, 0}, {2, 1}, {1, 1}, {0, 1}};
  for (const auto& p : corners) geo::addPoint(p[0], p[1], 0.0);
  for (int k = 1; k <= 6; ++k) geo::addLine(k, k % 6 + 1);
  geo::addLine(2, 5);
  geo::addCurveLoop({1, 7, 5, 6}, 1);
  geo::addCurveLoop({-4, -3, -2, 7}, 2);
  geo::addPlaneSurface({1}, 1);
  geo::addPlaneSurface({2}, 2);
  geo::synchronize();
  gmsh::model::setPhysicalName(1, gmsh::model::addPhysicalGroup(1, {1, 2}), "bottom");
  gmsh::model::setPhysicalName(1, gmsh::model::addPhysicalGroup(1, {3}), "right");
  gmsh::model::setPhysicalName(1, gmsh::model::addPhysicalGroup(1, {4, 5}), "top");
  gmsh::model::setPhysicalName(1, gmsh::model::addPhysicalGroup(1, {6}), "left");
  gmsh::model::setPhysicalName(2, gmsh::model::addPhysicalGroup(2, {1}), "clay");
  gmsh::model::setPhysicalName(2, gmsh::model::addPhysicalGroup(2, {2}), "sand");
  gmsh::model::mesh::generate(2);
  gmsh::write(file);
  gmsh::finalize();
  return file;
}

TEST(GmshMesh, ClockwiseSurfacesAreTurnedAndEdgesChainAcrossCurves) {
  const Mesh mesh = gmsh_mesh(two_surfaces());
  check_mesh(mesh);
  EXPECT_NEAR(area(mesh), 2.0, 1e-13);
  EXPECT_NEAR(twice_area_by_edges(mesh), 4.0, 1e-13);
  for (const std::string& name : edge_names(mesh)) expect_oriented_chain(mesh, name);
  EXPECT_NEAR(edge_length(mesh, "bottom"), 2.0, 1e-14);
  std::set<int> all;
  for (const char* region : {"clay", "sand"})
    all.insert(mesh.regions.at(region).begin(), mesh.regions.at(region).end());
  EXPECT_EQ(all.size(), mesh.elements.size());
  for (int e : mesh.regions.at("sand")) EXPECT_GT(element_centre(mesh, e).x(), 1.0);
}

TEST(GmshMesh, WrongFilesAreRefusedWithTheReason) {
  const auto sentence = [](const std::string& file) {
    try {
      gmsh_mesh(file);
      return std::string();
    } catch (const UserError& error) {
      return std::string(error.what());
    }
  };
  EXPECT_NE(
      sentence(case_file("triangles.geo")).find("14 elements of type 'Triangle 6', but only 8-node quadrilaterals"),
      std::string::npos);
  EXPECT_EQ(sentence("nowhere.msh"), "nowhere.msh: no such file; give a Gmsh mesh");
  EXPECT_NE(sentence(case_file("good.toml")).find("not a Gmsh file by its name"), std::string::npos);
  const std::string garbage = (std::filesystem::path(testing::TempDir()) / "garbage.msh").string();
  std::ofstream(garbage) << "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\nnone\n";
  EXPECT_NE(sentence(garbage).find("Gmsh cannot read it (Could not read nodes)"), std::string::npos);
  const std::string crashes = (std::filesystem::path(testing::TempDir()) / "crashes.geo").string();
  std::ofstream(crashes) << "Mesh.Algorithm = 8;\nMerge \"" << case_file("square.geo") << "\";\n";
  EXPECT_NE(sentence(crashes).find("Mesh.Algorithm = 8 is not safe"), std::string::npos);
}

}  // namespace
}  // namespace femxdem
