// Meshes as others write them: groups that overlap or share a name, parts that are not joined, round-off in z.
#include <fmt/format.h>
#include <gmsh.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "errors.hpp"
#include "mesh.hpp"
#include "mesh_gaps.hpp"
#include "mesh_measures.hpp"
#include "msh2_file.hpp"
#include "reference_element.hpp"

namespace femxdem {
namespace {

std::string data(const std::string& name) { return fmt::format("{}/mesh/{}", TEST_CASES, name); }

std::string refusal(const std::string& file) {
  try {
    gmsh_mesh(file);
    return "none";
  } catch (const UserError& error) {
    return error.what();
  }
}

/// Content of a file of the test data with its first `from` replaced, as a file of its own.
std::string changed(const std::string& name, const std::string& from, const std::string& to) {
  std::ostringstream text;
  text << std::ifstream(data(name)).rdbuf();
  std::string content = text.str();
  const std::size_t at = content.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  content.replace(at, from.size(), to);
  const std::string file = (std::filesystem::path(testing::TempDir()) / ("changed_" + name)).string();
  std::ofstream(file) << content;
  return file;
}

TEST(MeshFiles, AnElementOrSideIsOneInAllItsGroups) {
  const Mesh mesh = gmsh_mesh(data("two_groups_of_an_entity.msh"));
  EXPECT_EQ(mesh.elements.size(), 8u);
  EXPECT_NEAR(area(mesh), 1.0, 1e-12);
  EXPECT_EQ(mesh.regions.at("soil").size(), 8u);
  EXPECT_EQ(mesh.regions.at("weak").size(), 4u);
  EXPECT_NEAR(edge_length(mesh, "right"), 1.0, 1e-12);
  EXPECT_NEAR(edge_length(mesh, "upper_right"), 0.5, 1e-12);
}

TEST(MeshFiles, TwoGroupsOfOneNameAreOne) {
  const Mesh mesh = gmsh_mesh(data("one_name_of_two_groups.msh"));
  EXPECT_EQ(mesh.regions.at("soil").size(), 8u);
  for (const char* edge : {"bottom", "right", "top", "left"}) EXPECT_NEAR(edge_length(mesh, edge), 1.0, 1e-12) << edge;
}

TEST(MeshFiles, ZOfRoundOffIsZeroAndMoreIsNot) {
  EXPECT_NEAR(area(gmsh_mesh(data("z_of_round_off.msh"))), 1.0, 1e-12);
  const std::string lifted = changed("z_of_round_off.msh", "2 1 0 1.1102230246251565e-16", "2 1 0 1e-6");
  EXPECT_NE(refusal(lifted).find("node 2 lies at z = 1e-06"), std::string::npos) << refusal(lifted);
}

TEST(MeshFiles, PartsThatAreNotJoinedAreRefused) {
  const std::string said = refusal(data("not_joined.geo"));
  EXPECT_NE(said.find("5 pairs of nodes lie at one place"), std::string::npos) << said;
  EXPECT_NE(said.find("Coherence"), std::string::npos) << said;
  EXPECT_NE(said.find("Geometry.AutoCoherence"), std::string::npos) << said;
}

TEST(MeshFiles, HangingNodesAndOverlapsAreRefused) {
  Mesh mesh = rectangle_mesh(1.0, 1.0, 2, 1);
  EXPECT_NO_THROW(refuse_gaps(mesh, "m"));
  Mesh overlap = mesh;
  overlap.elements.push_back(overlap.elements[0]);
  EXPECT_THROW(refuse_gaps(overlap, "m"), UserError);
  Mesh hanging = mesh;
  hanging.elements[1][7] = hanging.elements[0][2];  // the middle of a side is the neighbour's corner
  EXPECT_THROW(refuse_gaps(hanging, "m"), UserError);
}

TEST(MeshFiles, EmptyOrNamelessGroupsAreRefused) {
  const std::string nameless = refusal(changed("plain.geo", "Physical Curve(\"top\")", "Physical Curve(77)"));
  EXPECT_NE(nameless.find("physical curve 77 has no name"), std::string::npos) << nameless;
  EXPECT_NE(
      refusal(changed("plain.geo", "Physical Surface(\"soil\")", "Physical Surface(78)")).find("physical surface 78"),
      std::string::npos);
  EXPECT_EQ(gmsh_mesh(data("without_names.geo")).edges.size(), 0u);
}

/// In processes of their own: Gmsh's parser does not forget a text that it could not end. _Exit: its leaks are not
/// ours.
TEST(MeshFiles, ErrorsInAGeometryAreRefused) {
  for (const char* wrong :
       {"Plane Surface(1) = {9};", "nonsense(1) = {1};", "Plane Surface(1) = {1}; BooleanFragments{ Surface{1};",
        "Plane Surface(1) = {1}; Transfinite Surface {1} = {1, 2, 9};"}) {
    const std::string file = changed("plain.geo", "Plane Surface(1) = {1};", wrong);
    EXPECT_EXIT(std::_Exit(refusal(file).find("Gmsh cannot read it") == std::string::npos), testing::ExitedWithCode(0),
                "");
  }
}

/// The plate with its upper half in two groups, a corner and a curve in a group of points and in two of curves, as Gmsh
/// writes it.
std::string overlapping(double version, bool binary) {
  const std::string file =
      (std::filesystem::path(testing::TempDir()) / fmt::format("groups_{}_{}.msh", version, binary)).string();
  gmsh::initialize(0, nullptr, false);
  gmsh::option::setNumber("General.Terminal", 0);
  gmsh::open(data("plain.geo"));
  namespace model = gmsh::model;
  model::setPhysicalName(2, model::addPhysicalGroup(2, {1}), "all");
  model::setPhysicalName(1, model::addPhysicalGroup(1, {3, 4}), "top_and_left");
  model::setPhysicalName(0, model::addPhysicalGroup(0, {1}), "corner");
  model::mesh::generate(2);
  gmsh::option::setNumber("Mesh.MshFileVersion", version);
  gmsh::option::setNumber("Mesh.Binary", binary);
  gmsh::write(file);
  gmsh::finalize();
  return file;
}

TEST(MeshFiles, GroupsOverlapInEveryFormatOfGmsh) {
  for (const double version : {2.2, 4.1}) {
    for (const bool binary : {false, true}) {
      SCOPED_TRACE(fmt::format("version {}, {}", version, binary ? "binary" : "text"));
      const Mesh mesh = gmsh_mesh(overlapping(version, binary));
      EXPECT_EQ(mesh.elements.size(), 4u);
      EXPECT_NEAR(area(mesh), 1.0, 1e-12);
      for (const char* region : {"soil", "all"}) EXPECT_EQ(mesh.regions.at(region), (std::vector<int>{0, 1, 2, 3}));
      for (const char* edge : {"bottom", "right", "top", "left"})
        EXPECT_NEAR(edge_length(mesh, edge), 1.0, 1e-12) << edge;
      EXPECT_NEAR(edge_length(mesh, "top_and_left"), 2.0, 1e-12);
    }
  }
}

/// Files of other programs give every element its group and all of them one elementary entity.
TEST(MeshFiles, GroupsOfFormat2AreThoseOfItsElements) {
  std::ostringstream text;
  text << std::ifstream(data("one_name_of_two_groups.msh")).rdbuf();
  std::istringstream lines(text.str());
  const std::string file = (std::filesystem::path(testing::TempDir()) / "one_entity.msh").string();
  std::ofstream out(file);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    int number = 0, type = 0, tags = 0, group = 0, entity = 0;
    if (line == "2 8 \"soil\"") line = "2 8 \"rock\"";
    if (words >> number >> type >> tags >> group >> entity && (type == 16 || type == 8) && tags == 2 && entity > 0) {
      std::string nodes;
      std::getline(words, nodes);
      line = fmt::format("{} {} 2 {} 1{}", number, type, group, nodes);
    }
    out << line << "\n";
  }
  out.close();
  const Mesh mesh = gmsh_mesh(file);
  EXPECT_EQ(mesh.regions.at("soil").size(), 4u);
  EXPECT_EQ(mesh.regions.at("rock").size(), 4u);
  for (const char* edge : {"bottom", "right", "top", "left"}) EXPECT_NEAR(edge_length(mesh, edge), 1.0, 1e-12) << edge;
}

}  // namespace
}  // namespace femxdem
