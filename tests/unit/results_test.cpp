#include "results.hpp"

#include <gtest/gtest.h>
#include <hdf5.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>

#include "errors.hpp"
#include "history.hpp"
#include "log.hpp"
#include "own_folder.hpp"
#include "summary.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

class ResultsTest : public OwnFolder {
 protected:
  std::string text(const char* name) const {
    std::ostringstream all;
    all << std::ifstream(folder_ / name).rdbuf();
    return all.str();
  }
};

/// Two unit squares side by side: 13 nodes, 2 x 4 points.
Mesh two_squares() {
  Mesh mesh;
  for (int i = 0; i <= 4; ++i) mesh.nodes.emplace_back(0.5 * i, 0.0);
  for (int i = 0; i <= 2; ++i) mesh.nodes.emplace_back(1.0 * i, 0.5);
  for (int i = 0; i <= 4; ++i) mesh.nodes.emplace_back(0.5 * i, 1.0);
  mesh.elements = {{0, 2, 10, 8, 1, 6, 9, 5}, {2, 4, 12, 10, 3, 7, 11, 6}};
  return mesh;
}

std::vector<Point2> points_of_two_squares() {
  const double g = 0.5 / std::numbers::sqrt3;
  std::vector<Point2> points;
  for (const double x : {0.5, 1.5}) {
    for (const double dy : {-g, g}) {
      for (const double dx : {-g, g}) points.emplace_back(x + dx, 0.5 + dy);
    }
  }
  return points;
}

Results results_in(const fs::path& folder, Existing existing, int last_step = 0) {
  prepare_output_folder(folder, existing);
  return {folder, two_squares(), points_of_two_squares(), existing, last_step};
}

FieldStep step_number(int step) {
  FieldStep fields{step, 0.1 * step, 0.01 * step, {}, {}};
  Field displacement{"displacement", 2, {}};
  for (int node = 0; node < 13; ++node)
    displacement.values.insert(displacement.values.end(), {1.0 * node, -2.0 * step});
  fields.node_fields = {displacement};
  fields.point_fields = {{"porosity", 1, {1, 2, 3, 4, 10, 20, 30, 40}}};
  return fields;
}

TEST_F(ResultsTest, FieldsAreReadBackWithTheirShapes) {
  Results results = results_in(folder_, Existing::refuse);
  results.write(step_number(7));
  const Hdf5File h5(folder_ / "results.h5", Hdf5File::Mode::read);
  EXPECT_EQ(h5.shape("/mesh/points"), (Shape{2, 4, 2}));
  EXPECT_EQ(h5.number("/steps/000007", "step"), 7);
  EXPECT_EQ(h5.number("/steps/000007", "time"), 0.1 * 7);
  EXPECT_EQ(h5.number("/steps/000007", "load_factor"), 0.01 * 7);
  EXPECT_EQ(h5.shape("/steps/000007/points/porosity"), (Shape{2, 4, 1}));
  EXPECT_EQ(h5.shape("/steps/000007/nodes/displacement"), (Shape{13, 3}));
  const std::vector<double> displacement = h5.read("/steps/000007/nodes/displacement");
  EXPECT_EQ(displacement[3 * 5], 5.0);
  EXPECT_EQ(displacement[3 * 5 + 1], -14.0);
  EXPECT_EQ(displacement[3 * 5 + 2], 0.0);
}

TEST_F(ResultsTest, CellsHoldTheMeansOfTheirPoints) {
  Results results = results_in(folder_, Existing::refuse);
  FieldStep fields = step_number(1);
  fields.point_fields.push_back({"pair", 2, {1, 0, 1, 0, 1, 0, 5, 4, 0, 1, 0, 2, 0, 3, 0, 6}});
  results.write(fields);
  const Hdf5File h5(folder_ / "results.h5", Hdf5File::Mode::read);
  EXPECT_EQ(h5.read("/steps/000001/cells/porosity"), (std::vector<double>{2.5, 25}));
  EXPECT_EQ(h5.read("/steps/000001/cells/pair"), (std::vector<double>{2, 1, 0, 3}));
}

TEST_F(ResultsTest, XdmfNamesEveryStepAndItsDataSets) {
  Results results = results_in(folder_, Existing::refuse);
  EXPECT_NE(text("results.xdmf").find("</Xdmf>"), std::string::npos);
  results.write(step_number(1));
  results.write(step_number(2));
  const std::string xdmf = text("results.xdmf");
  EXPECT_NE(xdmf.find("<Time Value=\"0.10000000000000001\"/>"), std::string::npos);
  EXPECT_NE(
      xdmf.find(
          "Dimensions=\"13 3\" NumberType=\"Float\" Precision=\"8\">results.h5:/steps/000002/nodes/displacement<"),
      std::string::npos);
  EXPECT_NE(xdmf.find("results.h5:/steps/000002/cells/porosity<"), std::string::npos);
  EXPECT_NE(xdmf.find("TopologyType=\"Quadrilateral_8\" NumberOfElements=\"2\""), std::string::npos);
}

TEST_F(ResultsTest, ResumedFilesEqualThoseOfAnUninterruptedRun) {
  const fs::path whole = folder_ / "whole";
  const fs::path parts = folder_ / "parts";
  {
    Results results = results_in(whole, Existing::refuse);
    for (const int step : {1, 2, 3}) results.write(step_number(step));
  }
  {
    Results results = results_in(parts, Existing::refuse);
    for (const int step : {1, 2, 4}) results.write(step_number(step));
  }
  Results resumed = results_in(parts, Existing::resume, 2);
  resumed.write(step_number(3));
  EXPECT_EQ(text("parts/results.xdmf"), text("whole/results.xdmf"));
  const Hdf5File h5(parts / "results.h5", Hdf5File::Mode::read);
  EXPECT_EQ(h5.members("/steps"), (std::vector<std::string>{"000001", "000002", "000003"}));
}

TEST_F(ResultsTest, AStepWrittenTwiceIsThereOnce) {
  Results results = results_in(folder_, Existing::refuse);
  results.write(step_number(1));
  const std::string once = text("results.xdmf");
  FieldStep again = step_number(1);
  again.time = 5;
  results.write(again);
  EXPECT_EQ(Hdf5File(folder_ / "results.h5", Hdf5File::Mode::read).number("/steps/000001", "time"), 5);
  EXPECT_EQ(text("results.xdmf").size(), once.size() - std::string("0.10000000000000001").size() + 1);
}

TEST_F(ResultsTest, AReaderThatHoldsTheFileDoesNotStopTheRun) {
  Results results = results_in(folder_, Existing::refuse);
  const pid_t reader = fork();
  if (reader == 0) {
    H5Fopen((folder_ / "results.h5").c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);  // with HDF5's own lock
    pause();
    _exit(0);
  }
  usleep(200000);
  EXPECT_NO_THROW(results.write(step_number(1)));
  kill(reader, SIGKILL);
  waitpid(reader, nullptr, 0);
}

TEST_F(ResultsTest, EarlierResultsAreOverwrittenOnlyWhenAsked) {
  { Results first = results_in(folder_, Existing::refuse); }
  try {
    Results second = results_in(folder_, Existing::refuse);
    FAIL() << "overwrote";
  } catch (const UserError& error) {
    EXPECT_EQ(std::string(error.what()), folder_.string() +
                                             ": holds the results of an earlier run; go on with --restart, replace "
                                             "them with --overwrite or choose another --out");
  }
  std::ofstream(folder_ / "notes.md") << "mine";
  Results third = results_in(folder_, Existing::overwrite);
  EXPECT_EQ(text("notes.md"), "mine");
}

TEST_F(ResultsTest, AFileInThePlaceOfTheFolderIsRefused) {
  std::ofstream(folder_) << "a file";
  EXPECT_THROW(prepare_output_folder(folder_, Existing::overwrite), UserError);
}

StepRecord record(int step) {
  return {step, 0.1 * step, 1.0 / 3.0, 2, 3, 1e6, 8, 1e-3 / 3, 1.5, 2.5, {-1.0 / 7.0, 1e-300}};
}

TEST_F(ResultsTest, HistoryHasOneRowAStepWithTheClockLast) {
  fs::create_directories(folder_);
  History history(folder_ / "history.csv", {"top", "side"}, Existing::refuse);
  history.add(record(1));
  EXPECT_EQ(text("history.csv"),
            "step,time,load_factor,iterations,evaluations,dem_steps,histories,residual,top,side,dem_seconds,wall_s\n"
            "1,0.10000000000000001,0.33333333333333331,2,3,1000000,8,0.00033333333333333332,-0.14285714285714285,"
            "1e-300,1.5,2.5\n");
}

TEST_F(ResultsTest, ResumedHistoryEqualsThatOfAnUninterruptedRun) {
  fs::create_directories(folder_);
  {
    History history(folder_ / "whole.csv", {"top", "side"}, Existing::refuse);
    for (int step = 1; step <= 12; ++step) history.add(record(step));
  }
  {
    History history(folder_ / "parts.csv", {"top", "side"}, Existing::refuse);
    for (int step = 1; step <= 11; ++step) history.add(record(step));
  }
  std::ofstream(folder_ / "parts.csv", std::ios::app) << "1";  // a row "12,..." cut by a crash
  History resumed(folder_ / "parts.csv", {"top", "side"}, Existing::resume, 10);
  resumed.add(record(11));
  resumed.add(record(12));
  EXPECT_EQ(text("parts.csv"), text("whole.csv"));
  EXPECT_THROW(History(folder_ / "parts.csv", {"top"}, Existing::resume, 10), UserError);
}

TEST_F(ResultsTest, BatchLogGetsPlainLinesAndTheFileTheTable) {
  fs::create_directories(folder_);
  std::FILE* batch = std::fopen((folder_ / "batch").c_str(), "w");
  {
    Log log(folder_ / "log.txt", Existing::refuse, batch);
    log.say("mesh: 128 elements");
    const std::vector<IterationRecord> iterations = {{1, 0.25, 0.5, 1, 0.5, 0.2, 7, "cut"}};
    log.step(record(3), iterations, 1.0);
  }
  std::fclose(batch);
  const std::string terminal = text("batch");
  const std::string line =
      "step    3  time 0.3        load 0.3333   iterations  2  evaluations  3  residual 3.3e-04  "
      "DEM 1.5 s  left 0 s\n";
  EXPECT_EQ(terminal, "mesh: 128 elements\n" + line);
  const std::string file = text("log.txt");
  EXPECT_NE(file.find("2.50e-01   5.00e-01"), std::string::npos);
  EXPECT_NE(file.find("cut\n"), std::string::npos);
  EXPECT_NE(file.find(line), std::string::npos);
}

TEST_F(ResultsTest, ProgressThatIsAskedForIsOneLineThatUpdatesAndPlainInTheFile) {
  fs::create_directories(folder_);
  std::FILE* batch = std::fopen((folder_ / "batch").c_str(), "w");
  {
    Log log(folder_ / "log.txt", Existing::refuse, batch, true);
    for (const int step : {1, 2}) log.step(record(step), {}, 0.5 * step);
  }
  std::fclose(batch);
  const std::string terminal = text("batch"), file = text("log.txt");
  EXPECT_EQ(terminal.find("\rstep    1"), 0u);
  EXPECT_NE(terminal.find("\033[K\rstep    2"), std::string::npos);
  EXPECT_EQ(std::count(terminal.begin(), terminal.end(), '\n'), 1);
  EXPECT_EQ(file.find_first_of("\r\033"), std::string::npos);
}

TEST_F(ResultsTest, ResumedLogKeepsTheEarlierText) {
  fs::create_directories(folder_);
  std::FILE* nowhere = std::fopen("/dev/null", "w");
  { Log(folder_ / "log.txt", Existing::refuse, nowhere).say("first"); }
  { Log(folder_ / "log.txt", Existing::resume, nowhere).say("second"); }
  EXPECT_EQ(text("log.txt"), "first\nsecond\n");
  std::fclose(nowhere);
}

TEST(Summary, IsJsonWithWhatFollowsFromTheCounts) {
  Summary summary;
  summary.status = "failed";
  summary.message = "a \"quote\"\n";
  summary.ranks = 2;
  summary.evaluate_seconds = 10;
  summary.trial_seconds = 19;
  summary.engine_seconds = 18;
  summary.versions = {{"yade", "2023.02a"}};
  const std::string json = to_json(summary, "2024-01-01T00:00:00Z", "host");
  EXPECT_NE(json.find("\"message\": \"a \\\"quote\\\"\\u000a\""), std::string::npos);
  EXPECT_NE(json.find("\"parallel_efficiency\": 0.95,"), std::string::npos);
  EXPECT_NE(json.find("\"engine_share\": 0.9,"), std::string::npos);
  EXPECT_NE(json.find("\"overhead_ratio\": 0.1,"), std::string::npos);
  EXPECT_NE(json.find("\"versions\": {\n    \"yade\": \"2023.02a\"\n  }\n}\n"), std::string::npos);
}

TEST(Summary, UnknownRatiosAreNull) {
  const std::string json = to_json(Summary{}, "", "");
  EXPECT_NE(json.find("\"parallel_efficiency\": null"), std::string::npos);
}

Tensor2 oblique_rotation(double angle) {
  return Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
}

const std::vector<double>& values(const std::vector<Field>& fields, const std::string& name) {
  for (const Field& field : fields) {
    if (field.name == name) return field.values;
  }
  throw std::out_of_range(name);
}

TEST(PointFields, StrainInvariantsOfStretchesAndRotations) {
  const double a = 0.2;
  const Tensor2 isochoric = Eigen::Vector3d(std::exp(a), std::exp(-a), 1).asDiagonal();
  const Tensor2 uniaxial = Eigen::Vector3d(std::exp(-a), 1, 1).asDiagonal();
  const std::vector<Tensor2> F = {isochoric, oblique_rotation(1.1) * isochoric, uniaxial, oblique_rotation(0.7)};
  const std::vector<Tensor2> stress(4, Tensor2::Identity());
  const auto fields = point_fields(F, stress, std::vector<PointReport>(4));
  const std::vector<double>& shear = values(fields, "strain_invariant");
  EXPECT_NEAR(shear[0], a * std::numbers::sqrt2, 1e-15);
  EXPECT_NEAR(shear[1], a * std::numbers::sqrt2, 1e-15);
  EXPECT_NEAR(shear[2], a * std::sqrt(2.0 / 3.0), 1e-15);
  EXPECT_NEAR(shear[3], 0, 1e-15);
  const std::vector<double>& volume = values(fields, "volumetric_strain");
  EXPECT_NEAR(volume[1], 0, 1e-15);
  EXPECT_NEAR(volume[2], -a, 1e-15);
}

TEST(PointFields, LogarithmicStrainFollowsTheStretch) {
  const Tensor2 Q = oblique_rotation(0.4);
  const Tensor2 E = Q * Eigen::Vector3d(0.1, -0.3, 0.05).asDiagonal() * Q.transpose();
  const Tensor2 U = Q * Eigen::Vector3d(std::exp(0.1), std::exp(-0.3), std::exp(0.05)).asDiagonal() * Q.transpose();
  EXPECT_LT((logarithmic_strain(oblique_rotation(2.0) * U) - E).norm(), 1e-15);
}

TEST(PointFields, StressInvariantsAndRowMajorTensors) {
  Tensor2 stress = Eigen::Vector3d(-3, -1, -2).asDiagonal();
  stress(0, 1) = 0.5;
  std::vector<PointReport> reports(1);
  reports[0].values[6] = 0.4;
  ASSERT_EQ(kReportFields[6], "porosity");
  const auto fields = point_fields(std::vector<Tensor2>{Tensor2::Identity()}, std::vector<Tensor2>{stress}, reports);
  EXPECT_EQ(values(fields, "stress"), (std::vector<double>{-3, 0.5, 0, 0, -1, 0, 0, 0, -2}));
  EXPECT_EQ(values(fields, "mean_stress")[0], -2);
  EXPECT_NEAR(values(fields, "deviatoric_stress")[0], std::sqrt(1.5 * (1 + 1 + 0.25)), 1e-15);
  EXPECT_EQ(values(fields, "porosity")[0], 0.4);
}

/// For P = c (F - I) the second-order work is c |dF|^2, whatever the rotation of the increment.
TEST(PointFields, SecondOrderWorkOfALinearNominalStress) {
  const double c = -2.5e6;
  const auto cauchy = [c](const Tensor2& F) {
    return Tensor2(c * (F - Tensor2::Identity()) * F.transpose() / F.determinant());
  };
  Tensor2 F0 = Tensor2::Identity();
  F0(0, 1) = 0.3;
  Tensor2 F1 = oblique_rotation(0.2) * F0;
  F1(2, 2) += 0.1;
  const auto work =
      second_order_work(std::vector{F0}, std::vector{cauchy(F0)}, std::vector{F1}, std::vector{cauchy(F1)});
  EXPECT_NEAR(work.values[0] / (c * (F1 - F0).squaredNorm()), 1, 1e-14);
}

}  // namespace
}  // namespace femxdem
