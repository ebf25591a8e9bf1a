#include "case.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "bad_cases.hpp"
#include "case_parameters.hpp"
#include "errors.hpp"
#include "mesh.hpp"
#include "own_folder.hpp"
#include "preset.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

const std::string kGood = std::string(TEST_CASES) + "/good.toml";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

std::string mistakes_of(const std::string& file, const std::vector<std::string>& overrides = {},
                        Purpose purpose = Purpose::run) {
  try {
    read_case(file, overrides, purpose);
    return "";
  } catch (const UserError& error) {
    return error.what();
  }
}

const fs::path kCases = fs::path(TEST_CASES).lexically_normal();

const std::map<std::string, BadCase>& bad_cases() {
  static const std::map<std::string, BadCase> cases = read_bad_cases(kCases / "bad.txt");
  return cases;
}

class RefusedCase : public testing::TestWithParam<std::string> {
 protected:
  /// Every bad case as a file in a folder of its own, beside what it names.
  static void SetUpTestSuite() {
    fs::create_directories(folder() / "bad");
    fs::copy_file(kCases / "triangles.geo", folder() / "triangles.geo");
    const std::vector<std::string> base = lines_of(kCases / "bad_base.toml");
    for (const auto& [name, bad] : bad_cases()) std::ofstream(file(name)) << changed(base, bad);
  }
  static void TearDownTestSuite() { fs::remove_all(folder()); }
  static fs::path folder() {
    return (fs::path(testing::TempDir()) / ("refused_cases_" + std::to_string(getpid()))).lexically_normal();
  }
  static std::string file(const std::string& name) { return (folder() / "bad" / (name + ".toml")).string(); }

  /// The sentences as read_case writes them.
  static std::string expected(const std::string& name) {
    std::string text;
    for (const std::string& sentence : bad_cases().at(name).expected)
      text += (text.empty() ? "FILE:" : "\nFILE:") + sentence;
    return replaced(replaced(text, "FILE", file(name)), "DIR", folder().string());
  }
};

std::vector<std::string> names_of_bad_cases() {
  std::vector<std::string> names;
  for (const auto& entry : bad_cases()) names.push_back(entry.first);
  return names;
}

TEST_P(RefusedCase, HasItsSentences) {
  ASSERT_FALSE(expected(GetParam()).empty());
  EXPECT_EQ(mistakes_of(file(GetParam())), expected(GetParam()));
}

INSTANTIATE_TEST_SUITE_P(All, RefusedCase, testing::ValuesIn(names_of_bad_cases()),
                         [](const auto& info) { return info.param; });

TEST(Case, TheBaseOfTheBadCasesIsGood) { EXPECT_EQ(mistakes_of((kCases / "bad_base.toml").string()), ""); }

TEST(Case, GoodCaseIsRead) {
  const Case c = read_case(kGood);
  EXPECT_EQ(c.mesh.nx, 4);
  EXPECT_EQ(c.mesh.height, 2.0);
  EXPECT_EQ(c.element.type, ElementType::second_gradient);
  EXPECT_EQ(c.element.D, 2000.0);
  EXPECT_EQ(c.material.type, MaterialType::drucker_prager);
  EXPECT_EQ(c.material_regions.at(0).material.cohesion, 1.8e4);
  EXPECT_EQ(c.material_regions.at(0).material.hardening, -1e6) << "taken from the base";
  ASSERT_EQ(c.loads.size(), 6u);
  EXPECT_EQ(c.loads[1].point, (std::vector<double>{0.5, 0.0}));
  EXPECT_EQ(c.loads[2].kind, LoadKind::velocity);
  EXPECT_EQ(c.loads[2].component, Component::y);
  EXPECT_EQ(c.loads[5].component, Component::xy);
  EXPECT_EQ(c.solver.global_operator, GlobalOperator::tangent) << "default of closed forms";
  EXPECT_EQ(c.solver.tolerance, 1e-8);
  EXPECT_EQ(c.control.min_step, 0.05 / 64.0);
  EXPECT_EQ(c.monitors.at(1).quantity, Quantity::stress_yy);
  EXPECT_EQ(c.path.at(0).strain[1], -0.1);
  EXPECT_EQ(c.path.at(0).stress[0], -1e5);
  EXPECT_FALSE(is_given(c.path.at(0).strain[2]));
}

TEST(Case, OverridesComeBeforeTheFile) {
  const Case c =
      read_case(kGood, {"mesh.nx=8", "load.2.value=-0.5", "element.type=q8", "ve.seeds=[7]", "ve.assignment=\"same\"",
                        "solver.qn_max=2", "load.5.kind=velocity", "load.5.component=x"});
  EXPECT_EQ(c.mesh.nx, 8);
  EXPECT_EQ(c.loads[2].value, -0.5);
  EXPECT_EQ(c.element.type, ElementType::q8) << "a bare word is a text";
  EXPECT_EQ(c.ve.seeds, std::vector<int>{7});
  EXPECT_EQ(c.solver.qn_max, 2.0) << "an integer is a number";
}

TEST(Case, MistakesInOverridesNameTheOverride) {
  EXPECT_EQ(mistakes_of(kGood, {"mesh.nx=0"}), "--set mesh.nx=0: mesh.nx = 0 is out of bounds; give an integer >= 1");
  EXPECT_EQ(mistakes_of(kGood, {"mesh.nxx=3"}), "--set mesh.nxx=3: unknown key 'nxx' in [mesh]; did you mean 'nx'?");
  EXPECT_EQ(mistakes_of(kGood, {"mesh.nx"}),
            "--set mesh.nx: not of the form key=value; write for example --set control.step=1e-3");
  EXPECT_EQ(mistakes_of(kGood, {"load.9.value=1"}),
            "--set load.9.value=1: there is no '9' to set; count entries of arrays from 0");
}

TEST(Case, MissingFileIsNamed) {
  EXPECT_EQ(mistakes_of("nowhere.toml"), "nowhere.toml: no such case file; correct the path");
}

TEST(Case, EffectiveCaseReadsBackToTheSame) {
  const fs::path copy = fs::path(testing::TempDir()) / "effective_case.toml";
  for (const std::vector<std::string>& overrides :
       {std::vector<std::string>{}, {"material.young=0.1", "output.directory=\"a \\\"quoted\\\" \\\\ name\""}}) {
    const Case c = read_case(kGood, overrides);
    std::ofstream(copy) << effective_toml(c);
    const Case again = read_case(copy.string());
    EXPECT_EQ(effective_toml(again), effective_toml(c));
    EXPECT_EQ(case_hash(again), case_hash(c));
    EXPECT_EQ(again.output.directory, c.output.directory);
    EXPECT_EQ(again.material.young, c.material.young);
  }
}

TEST(Case, EffectiveCaseHoldsEveryParameterThatIsGiven) {
  const std::string text = effective_toml(read_case(kGood));
  for (const char* line : {"young = 50000000.0", "qn_skew = 0.6", "kappa = 500.0", "max_iterations_to_grow = 6",
                           "point = [0.5, 0.0]", "table = [[0.0, 0.0], [1.0, 1.0]]", "line_search = true"})
    EXPECT_NE(text.find(std::string("\n") + line + "\n"), std::string::npos) << line;
}

TEST(Case, ReferenceMentionsEveryParameterWithItsText) {
  const std::string text = describe_parameters();
  const Case none;
  for_each_section(none, [&text](const auto& section, const auto&) {
    EXPECT_NE(text.find("[" + section.name + "]"), std::string::npos) << section.name;
    EXPECT_FALSE(section.text.empty());
    for (const auto& p : section.parameters) {
      EXPECT_NE(text.find("  " + p.key + " "), std::string::npos) << section.name << "." << p.key;
      EXPECT_FALSE(p.text.empty()) << section.name << "." << p.key;
    }
  });
}

TEST(Case, DefaultsAreWithinTheirBounds) {
  const Case none;
  for_each_section(none, []<class S, class V>(const Section<S>& section, const V&) {
    for (const Parameter<S>& p : section.parameters) {
      const Value value = p.get(S{});
      const double* number = std::get_if<double>(&value);
      if (number && is_given(*number)) {
        EXPECT_TRUE(p.bounds.contain(*number)) << section.name << "." << p.key;
      }
    }
  });
}

TEST(Case, HashFollowsWhatIsComputedAlone) {
  const std::string hash = case_hash(read_case(kGood));
  EXPECT_EQ(hash.size(), 16u);
  EXPECT_EQ(hash, case_hash(read_case(kGood, {"output.every=7", "output.directory=elsewhere", "ve.cache=there"})));
  EXPECT_NE(hash, case_hash(read_case(kGood, {"solver.tolerance=1e-7"})));
  EXPECT_NE(hash, case_hash(read_case(kGood, {"load.3.value=100000.00000001"}))) << "last bits count";
}

TEST(Case, HashFollowsTheContentsOfFiles) {
  const fs::path folder = fs::path(testing::TempDir()) / "case_hash";
  fs::create_directories(folder / "elsewhere");
  const auto hash_of = [&](const std::string& where, const std::string& script) {
    std::ofstream(folder / where / "cell.py") << script;
    std::ofstream(folder / where / "case.toml")
        << "[ve]\nsource = \"script\"\nscript = \"cell.py\"\n[[path]]\nstrain_yy = 0.1\n";
    return case_hash(read_case((folder / where / "case.toml").string(), {}, Purpose::ve_path));
  };
  const std::string first = hash_of(".", "O.periodic = True");
  EXPECT_EQ(first, hash_of("elsewhere", "O.periodic = True"));
  EXPECT_NE(first, hash_of("elsewhere", "O.periodic = False"));
}

TEST(Case, PathOfAPointNeedsNoMesh) {
  const fs::path file = fs::path(testing::TempDir()) / "path_only.toml";
  std::ofstream(file) << "[ve]\nspheres = 200\n[[path]]\nstrain_yy = -0.1\nstress_xx = -1e5\nincrements = 20\n";
  const Case c = read_case(file.string(), {}, Purpose::ve_path);
  EXPECT_EQ(c.path.at(0).increments, 20);
  EXPECT_EQ(c.ve.spheres, 200);
  const fs::path copy = fs::path(testing::TempDir()) / "path_only_effective.toml";
  std::ofstream(copy) << effective_toml(c);
  EXPECT_EQ(effective_toml(read_case(copy.string(), {}, Purpose::ve_path)), effective_toml(c));
  EXPECT_NE(mistakes_of(file.string()).find("mesh.type is missing"), std::string::npos) << "but a run does";
  EXPECT_NE(mistakes_of(kGood, {"path=[]"}, Purpose::ve_path).find("there is no path to follow"), std::string::npos);
}

TEST(Case, FrictionLawHasNoCohesionUnlessGiven) {
  EXPECT_EQ(read_case(kGood, {"ve.contact_law=friction"}).ve.cohesion, 0.0);
  EXPECT_EQ(read_case(kGood).ve.cohesion, 1.0);
}

class CaseWithPreset : public OwnFolder {
 protected:
  /// Biaxial on volume elements without a number that a preset gives: 0.1 m/s on 2 m.
  std::string file() const {
    fs::create_directories(folder_);
    std::ofstream(folder_ / "preset.toml")
        << "mesh = { type = \"rectangle\", width = 1.0, height = 2.0, nx = 2, ny = 4 }\n"
           "load = [ { edge = \"bottom\", kind = \"displacement\", component = \"y\", value = 0.0 },\n"
           "         { edge = \"top\", kind = \"velocity\", component = \"y\", value = -0.1 },\n"
           "         { point = [0.5, 0.0], kind = \"displacement\", component = \"x\", value = 0.0 } ]\n"
           "control = { end_time = 1.0 }\n";
    return (folder_ / "preset.toml").string();
  }
};

/// The table of presets in validation/speed_accuracy/README.md.
TEST_F(CaseWithPreset, GetsWhatItDoesNotGive) {
  struct Row {
    const char* name;
    int spheres;
    double inertial_number;
    int min_steps;
    double increment, tolerance;
  };
  for (const Row& row : {Row{"fast", 100, 2e-2, 10, 2e-3, 1e-2}, Row{"balanced", 400, 5e-3, 3, 1e-3, 5e-3},
                         Row{"accurate", 1000, 5e-3, 3, 5e-4, 5e-3}}) {
    SCOPED_TRACE(row.name);
    const Case c = read_case(file(), {std::string("ve.preset=") + row.name});
    EXPECT_EQ(c.ve.spheres, row.spheres);
    EXPECT_EQ(c.ve.inertial_number, row.inertial_number);
    EXPECT_EQ(c.ve.min_steps, row.min_steps);
    EXPECT_EQ(c.solver.tolerance, row.tolerance);
    EXPECT_NEAR(c.control.step, row.increment / 0.05, 1e-15) << "0.05 of strain in a second";
    EXPECT_EQ(c.control.max_step, c.control.step);
  }
  EXPECT_NE(mistakes_of(kGood, {"ve.preset=quick"}).find("balanced"), std::string::npos);
}

/// Rows of validation/speed_accuracy/README.md: name, settings, errors in percent.
TEST_F(CaseWithPreset, IsThatOfItsPage) {
  std::ifstream page(fs::path(TEST_CASES).parent_path().parent_path() / "validation/speed_accuracy/README.md");
  std::map<std::string, std::vector<double>> rows;
  for (std::string line; std::getline(page, line);) {
    if (line.rfind("| `", 0) != 0) continue;
    const std::string name = line.substr(3, line.find('`', 3) - 3);
    std::istringstream cells(line.substr(line.find('|', 3) + 1));
    for (std::string cell; rows[name].size() < 10 && std::getline(cells, cell, '|');)
      rows[name].push_back(std::stod(cell));
  }
  for (const VePreset which : {VePreset::fast, VePreset::balanced, VePreset::accurate}) {
    const Preset& p = preset(which);
    SCOPED_TRACE(p.name);
    const std::vector<double> own = {
        double(p.spheres),         p.inertial_number, double(p.min_steps), p.increment,  p.tolerance,
        double(p.elements_across), 100 * p.peak,      100 * p.residual,    100 * p.band, 100 * p.curve};
    ASSERT_EQ(rows[p.name].size(), own.size());
    for (std::size_t i = 0; i < own.size(); ++i) EXPECT_NEAR(rows[p.name][i], own[i], 1e-12) << "column " << i + 1;
  }
}

/// The choice of validation/quasi_static, where nothing that is given is against it.
TEST_F(CaseWithPreset, SlowTrialsAnswerWithTheirMeanUnlessGiven) {
  struct Row {
    std::vector<std::string> words;
    VeAnswer answer;
    LastCorrection last;
  };
  for (const Row& row :
       {Row{{}, VeAnswer::mean, LastCorrection::learned},
        Row{{"ve.inertial_number=2e-3"}, VeAnswer::mean, LastCorrection::learned},
        Row{{"ve.inertial_number=6e-3"}, VeAnswer::end, LastCorrection::evaluated},
        Row{{"ve.inertial_number=6e-3", "ve.answer=mean"}, VeAnswer::mean, LastCorrection::learned},
        Row{{"ve.answer=end"}, VeAnswer::end, LastCorrection::evaluated},
        Row{{"solver.last_correction=evaluated"}, VeAnswer::mean, LastCorrection::evaluated},
        Row{{"solver.acceleration=anderson"}, VeAnswer::mean, LastCorrection::evaluated},
        Row{{"solver.operator=elastic"}, VeAnswer::mean, LastCorrection::evaluated},
        Row{{"solver.reuse_below=0.1"}, VeAnswer::end, LastCorrection::evaluated},
        Row{{"ve.contact_law=paper", "ve.hold_steps=20"}, VeAnswer::end, LastCorrection::evaluated},
        Row{{"material.young=1e7", "material.type=elastic"}, VeAnswer::end, LastCorrection::evaluated}}) {
    std::vector<std::string> words = {"control.step=0.02"};
    words.insert(words.end(), row.words.begin(), row.words.end());
    SCOPED_TRACE(row.words.empty() ? "as it is" : row.words.back());
    const Case c = read_case(file(), words);
    EXPECT_EQ(c.ve.answer, row.answer);
    EXPECT_EQ(c.solver.last_correction, row.last);
  }
  EXPECT_EQ(read_case(file(), {"control.step=0.02"}, Purpose::ve_of_run).ve.answer, VeAnswer::end);
}

TEST_F(CaseWithPreset, KeepsWhatItGives) {
  const Case c = read_case(file(), {"ve.preset=fast", "ve.spheres=321", "ve.inertial_number=3e-3", "ve.min_steps=7",
                                    "solver.tolerance=2e-3", "control.step=0.01"});
  EXPECT_EQ(c.ve.spheres, 321);
  EXPECT_EQ(c.ve.inertial_number, 3e-3);
  EXPECT_EQ(c.ve.min_steps, 7);
  EXPECT_EQ(c.solver.tolerance, 2e-3);
  EXPECT_EQ(c.control.step, 0.01);
  const Case law = read_case(kGood, {"ve.preset=fast"});
  EXPECT_EQ(law.solver.tolerance, 1e-8) << "a preset is of volume elements";
  EXPECT_EQ(law.control.step, read_case(kGood).control.step);
}

TEST_F(CaseWithPreset, GetsAStepWhereItsEdgesAreMovedInTime) {
  const double increment = preset(VePreset::fast).increment;
  const auto step = [&](std::vector<std::string> words) {
    words.push_back("ve.preset=fast");
    return read_case(file(), words).control.step;
  };
  EXPECT_NEAR(step({"load.1.kind=displacement"}), increment / 0.05, 1e-15) << "value at end_time = 1 s";
  EXPECT_NEAR(step({"load.1.table=[[0.0, 0.0], [0.5, 2.0], [1.0, 2.0]]"}), increment / 0.2, 1e-15)
      << "0.4 m/s at first";
  EXPECT_NEAR(step({"load.0.value=0.1"}), increment / 0.1, 1e-15) << "both edges";
  EXPECT_EQ(step({"load.1.value=-1e-4"}), 1.0) << "not beyond the end";
  EXPECT_NE(mistakes_of(file(), {"ve.preset=fast", "load.1.value=0.0"}).find("control.step is missing"),
            std::string::npos);
  EXPECT_NE(mistakes_of(file()).find("control.step is missing; give it (s)"), std::string::npos);
}

TEST(Load, FactorFollowsItsTableOrItsKind) {
  Load load;
  load.table = {{1.0, 0.0}, {2.0, 1.0}, {4.0, -1.0}};
  EXPECT_EQ(load_factor(load, 0.5, 9.0), 0.0);
  EXPECT_EQ(load_factor(load, 1.5, 9.0), 0.5);
  EXPECT_EQ(load_factor(load, 2.0, 9.0), 1.0);
  EXPECT_EQ(load_factor(load, 3.5, 9.0), -0.5);
  EXPECT_EQ(load_factor(load, 8.0, 9.0), -1.0);
  load.table.clear();
  EXPECT_EQ(load_factor(load, 2.0, 8.0), 0.25);
  load.kind = LoadKind::velocity;
  EXPECT_EQ(load_factor(load, 2.0, 8.0), 2.0);
  load.kind = LoadKind::pressure;
  EXPECT_EQ(load_factor(load, 2.0, 8.0), 1.0);
}

Case volume_elements(const std::vector<std::string>& more) {
  std::vector<std::string> overrides = {"material={type=\"volume_element\"}",
                                        "ve.region=[{region=\"weak\", friction=0.4}]"};
  overrides.insert(overrides.end(), more.begin(), more.end());
  return read_case(kGood, overrides);
}

TEST(VePool, RegionsAndSeedsMakeTemplates) {
  const Case c = volume_elements({"ve.assignment=same", "ve.seeds=[5, 6]"});
  const Mesh mesh = make_mesh(c.mesh, c.regions);
  const VePool pool = ve_pool(c, mesh);
  ASSERT_EQ(pool.templates.size(), 2u) << "the second seed is not in use";
  EXPECT_EQ(pool.templates[0].friction, 0.5);
  EXPECT_EQ(pool.templates[1].friction, 0.4);
  EXPECT_EQ(pool.templates[1].seed, 5);
  ASSERT_EQ(pool.template_of_point.size(), 128u);
  for (int p = 0; p < 128; ++p) EXPECT_EQ(pool.template_of_point[p], p / 4 == 9 ? 1 : 0) << p;
}

TEST(VePool, RandomAssignmentFollowsItsSeedAlone) {
  const Case c = volume_elements({"ve.assignment_seed=3"});
  const Mesh mesh = make_mesh(c.mesh, c.regions);
  const VePool pool = ve_pool(c, mesh), again = ve_pool(c, mesh);
  EXPECT_EQ(pool.template_of_point, again.template_of_point);
  EXPECT_NE(pool.template_of_point, ve_pool(volume_elements({"ve.assignment_seed=4"}), mesh).template_of_point);
  std::set<int> seeds;
  for (int t : pool.template_of_point) seeds.insert(pool.templates.at(t).seed);
  EXPECT_EQ(seeds, (std::set<int>{1, 2, 3}));
  EXPECT_EQ(pool.templates.size(), 4u) << "three seeds, and one of them in the weak region";
}

TEST(VePool, SpecIsJsonOfOneVolumeElement) {
  VeParameters ve;
  ve.seed = 7;
  ve.seeds = {7, 8};
  ve.arguments = {"--wet", "a \"b\""};
  const std::string json = ve_spec_json(ve);
  EXPECT_EQ(json.front(), '{');
  EXPECT_NE(json.find("\"seed\": 7,"), std::string::npos);
  EXPECT_NE(json.find("\"contact_law\": \"adhesive\""), std::string::npos);
  EXPECT_NE(json.find("\"new_contacts\": \"frictional\""), std::string::npos);
  EXPECT_NE(json.find("\"confining_stress\": 100000.0"), std::string::npos);
  EXPECT_NE(json.find("\"arguments\": [\"--wet\", \"a \\\"b\\\"\"]"), std::string::npos);
  EXPECT_EQ(json.find("seeds"), std::string::npos);
}

TEST(Materials, RegionsOverrideTheBase) {
  const Case c = read_case(kGood);
  const auto materials = material_of_element(c, make_mesh(c.mesh, c.regions));
  for (int e = 0; e < 32; ++e) EXPECT_EQ(materials[e].cohesion, e == 9 ? 1.8e4 : 2e4) << e;
}

}  // namespace
}  // namespace femxdem
