#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <fstream>
#include <random>
#include <sstream>

#include "analytic_points.hpp"
#include "errors.hpp"
#include "path.hpp"
#include "path_driver.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

enum { xx, yy, zz, xy, yz, zx };

SolverParameters tight() {
  SolverParameters parameters;
  parameters.tolerance = 1e-9;
  parameters.displacement_tolerance = 1e-6;
  return parameters;
}

/// Stress kept at 0 in all components but those with a strain.
PathSegment free_but(std::array<double, 6> strain, int increments) {
  PathSegment segment;
  segment.strain = strain;
  segment.increments = increments;
  for (int c = 0; c < 6; ++c) {
    if (!is_given(strain[c])) segment.stress[c] = 0;
  }
  return segment;
}

std::array<double, 6> only(int component, double value) {
  std::array<double, 6> values;
  values.fill(kNotGiven);
  values[component] = value;
  return values;
}

int follow(PathDriver& driver, const PathSegment& segment) {
  int evaluations = 0;
  driver.begin_segment(segment);
  for (int i = 1; i <= segment.increments; ++i) {
    const PathStep step = driver.solve(static_cast<double>(i) / segment.increments);
    EXPECT_TRUE(step.converged) << step.reason;
    evaluations += static_cast<int>(step.table.size());
    driver.commit();
  }
  return evaluations;
}

TEST(PathDriver, UniaxialStressOfElasticity) {
  AnalyticPoints point({ElasticLaw{1000, 0.25, 0}});
  PathDriver driver(point, tight());
  follow(driver, free_but(only(yy, std::log(1.05)), 5));
  EXPECT_NEAR(driver.response().stress(1, 1), 1000 * 0.05, 1e-6);
  EXPECT_NEAR(driver.F()(0, 0) - 1, -0.25 * 0.05, 1e-9);
  EXPECT_NEAR(driver.F()(2, 2) - 1, -0.25 * 0.05, 1e-9);
}

TEST(PathDriver, ShearStressIsReachedInItsComponent) {
  AnalyticPoints point({ElasticLaw{1000, 0.25, 0}});  // G = 400
  PathDriver driver(point, tight());
  PathSegment segment;
  segment.stress[xy] = 10;
  follow(driver, segment);
  EXPECT_NEAR(driver.response().stress(0, 1), 10, 1e-7);
  EXPECT_NEAR(path_strain(driver.F())[xy], std::asinh(10 / 800.0), 1e-9);
  for (const int c : {xx, yy, zz, yz, zx}) EXPECT_NEAR(path_strain(driver.F())[c], 0, 1e-15);
}

TEST(PathDriver, HeldStressFromAnInitialPressure) {
  AnalyticPoints point({ElasticLaw{1000, 0.25, 2}});
  PathDriver driver(point, tight());
  PathSegment segment;
  segment.strain[yy] = std::log(0.99);
  segment.stress[xx] = -2;
  follow(driver, segment);
  // plane strain with free xx: sigma_yy = E / (1 - nu^2) e, e_xx = -nu / (1 - nu) e
  EXPECT_NEAR(driver.response().stress(1, 1), -2 - 10 / (1 - 0.0625), 1e-6);
  EXPECT_NEAR(driver.F()(0, 0) - 1, 0.01 / 3, 1e-9);
  EXPECT_NEAR(driver.response().stress(0, 0), -2, 1e-7);
}

/// sigma = (Y + H eps) / (1 + H / E), eps logarithmic; unloading along E.
TEST(PathDriver, UniaxialCycleOfHardeningPlasticity) {
  const double E = 1000, Y = 6, H = 100;
  AnalyticPoints point({VonMisesLaw{E, 0.25, Y, H, 0, 0}});
  PathDriver driver(point, tight());
  const int evaluations = follow(driver, free_but(only(yy, 0.05), 50));
  EXPECT_NEAR(driver.response().stress(1, 1), (Y + H * 0.05) / (1 + H / E), 1e-5);
  const double before = driver.response().stress(1, 1);
  follow(driver, free_but(only(yy, 0.045), 5));
  EXPECT_NEAR(driver.response().stress(1, 1), before - E * 0.005, 1e-5);
  EXPECT_LE(evaluations, 4 * 50);
}

/// The strain is ln V and the stress Cauchy: after a rotation by 90 degrees x carries what y did.
TEST(PathDriver, GoesOnAfterARotation) {
  AnalyticPoints point({JaumannLaw{1000, 0.25, 0}});
  PathDriver driver(point, tight());
  follow(driver, free_but(only(yy, 0.02), 20));
  const Tensor2 stress = driver.response().stress;
  Tensor2 Q;
  Q << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  PathSegment rotation;
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> F = Q * driver.F();
  rotation.deformation_gradient.assign(F.data(), F.data() + 9);
  rotation.increments = 1;
  follow(driver, rotation);
  EXPECT_LE((driver.response().stress - rotate(stress, Q)).norm(), 1e-12 * stress.norm());
  EXPECT_NEAR(path_strain(driver.F())[xx], 0.02, 1e-12);
  follow(driver, free_but(only(xx, 0.0), 20));
  EXPECT_NEAR(driver.response().stress(0, 0), 0, 1e-4);
  EXPECT_LE((driver.F() - Q).norm(), 1e-6);
}

TEST(PathDriver, ASegmentWithoutTargetsKeepsTheStrain) {
  AnalyticPoints point({ElasticLaw{1000, 0.25, 2}});
  PathDriver driver(point, tight());
  follow(driver, free_but(only(yy, -0.01), 2));
  const Tensor2 F = driver.F();
  follow(driver, {});
  EXPECT_LE((driver.F() - F).norm(), 1e-14);
}

/// Elasticity with a jitter that depends on the bits of F alone, rectangular with this standard deviation.
class Jittering : public AnalyticPoints {
 public:
  explicit Jittering(double deviation) : AnalyticPoints({ElasticLaw{1000, 0.25, 10}}), deviation_(deviation) {}
  std::vector<Response> evaluate(std::span<const Tensor2> F, Operator wanted) override {
    auto responses = AnalyticPoints::evaluate(F, wanted);
    std::seed_seq seed(reinterpret_cast<const unsigned*>(F[0].data()),
                       reinterpret_cast<const unsigned*>(F[0].data()) + 18);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> jitter(-std::sqrt(3.0), std::sqrt(3.0));
    for (double& s : responses[0].stress.reshaped()) s += deviation_ * jitter(random);
    return responses;
  }

 private:
  double deviation_;
};

TEST(PathDriver, NoiseIsMeasuredAsItIs) {
  for (const double deviation : {0.0, 1e-4}) {
    Jittering point(deviation);
    SolverParameters parameters = tight();
    parameters.tolerance = 1e-3;
    PathDriver driver(point, parameters);
    PathSegment segment;
    segment.strain[yy] = -0.01;
    segment.increments = 1;
    driver.begin_segment(segment);
    ASSERT_TRUE(driver.solve(1).converged);
    const double noise = driver.noise(1e-6, 400);
    driver.commit();
    const double expected = 3 * deviation / driver.response().stress.norm();  // nine components
    EXPECT_NEAR(noise, expected, 0.1 * expected + 1e-10);    // E amplitude^2 / |sigma|: the curvature of exp
    EXPECT_NEAR(path_strain(driver.F())[yy], -0.01, 1e-12);  // the trial itself is committed
  }
}

// ---- the files

struct Follow : testing::Test {
  Follow() : folder(fs::temp_directory_path() / ("ve_path_" + std::to_string(getpid()))) { options.folder = folder; }
  ~Follow() override { fs::remove_all(folder); }

  std::string text(const char* name) const {
    std::ostringstream all;
    all << std::ifstream(folder / name).rdbuf();
    return all.str();
  }
  /// A column of history.csv.
  std::vector<double> column(const std::string& name) const {
    std::istringstream rows(text("history.csv"));
    std::vector<double> values;
    std::size_t place = 0;
    bool names = true;
    for (std::string row; std::getline(rows, row); names = false) {
      std::istringstream cells(row);
      std::vector<std::string> list;
      for (std::string cell; std::getline(cells, cell, ',');) list.push_back(cell);
      if (names) {
        place = static_cast<std::size_t>(std::find(list.begin(), list.end(), name) - list.begin());
        EXPECT_LT(place, list.size()) << name;
      } else {
        values.push_back(std::stod(list.at(place)));
      }
    }
    return values;
  }

  fs::path folder;
  RunOptions options;
};

const std::string kGood = std::string(TEST_CASES) + "/good.toml";

TEST_F(Follow, OneFileServesTheProblemAndItsMaterial) {
  std::ifstream good(kGood);
  std::string without_path{std::istreambuf_iterator<char>(good), {}};
  without_path.resize(without_path.find("[[path]]"));
  fs::create_directories(folder);
  const std::string problem = folder / "problem.toml";
  std::ofstream(problem) << without_path;
  const Case c = read_path_case(problem, {});
  ASSERT_EQ(c.path.size(), 1U);
  EXPECT_EQ(c.path[0].stress[xx], -1e5);
  EXPECT_DOUBLE_EQ(c.path[0].strain[yy], std::log1p(-0.05));
  EXPECT_EQ(c.path[0].increments, 51);
  EXPECT_EQ(read_path_case(kGood, {}).path[0].strain[yy], -0.1);
  EXPECT_THROW(read_path_case(problem, {"control.step=-1.0"}), UserError);
}

TEST_F(Follow, WritesTheFilesOfARun) {
  const Case c =
      read_path_case(kGood, {"path.0.strain_yy=-0.001", "path.0.stress_xx=-1e4", "material.initial_pressure=1e4"});
  EXPECT_EQ(follow_path(c, *make_analytic_point(c), options), kDone);
  EXPECT_EQ(column("time").size(), 51U);  // the start and 50 increments
  EXPECT_NEAR(column("strain_yy").back(), -0.001, 1e-15);
  EXPECT_NEAR(column("stress_xx").back(), -1e4, 1e-3);
  EXPECT_NEAR(column("F_22").back(), std::exp(-0.001), 1e-15);
  EXPECT_EQ(column("strain_yy").front(), 0);
  EXPECT_NE(text("summary.json").find("\"status\": \"done\""), std::string::npos);
  EXPECT_EQ(read_case((folder / "case.toml").string(), {}, Purpose::ve_path).path[0].strain[yy], -0.001);
  EXPECT_THROW(follow_path(c, *make_analytic_point(c), options), UserError);  // results are there
}

/// Tells the process to end after some steps.
class TellingPoint : public AnalyticPoints {
 public:
  using AnalyticPoints::AnalyticPoints;
  void commit() override {
    AnalyticPoints::commit();
    if (++commits_ == 9) std::raise(SIGUSR1);
  }

 private:
  int commits_ = 0;
};

TEST_F(Follow, ToldToEndItGoesOnAsIfNothingHadBeen) {
  const Case c =
      read_path_case(kGood, {"path.0.strain_yy=-0.001", "path.0.stress_xx=-1e4", "material.initial_pressure=1e4"});
  EXPECT_EQ(follow_path(c, *make_analytic_point(c), options), kDone);
  std::vector<std::vector<double>> whole;
  for (const char* name : {"step", "time", "evaluations", "residual", "strain_xx", "stress_yy"})
    whole.push_back(column(name));
  int ended = 0, status = kRunAgain;
  options.existing = Existing::overwrite;
  for (; status == kRunAgain && ended < 20; ++ended) {
    TellingPoint point({make_law(c.material)});
    status = follow_path(c, point, options);
    options.existing = Existing::resume;
  }
  EXPECT_EQ(status, kDone);
  EXPECT_EQ(ended, 7) << "runs of at most eight steps";
  std::size_t k = 0;
  for (const char* name : {"step", "time", "evaluations", "residual", "strain_xx", "stress_yy"})
    EXPECT_EQ(column(name), whole[k++]) << name;
}

/// Stress control cannot pass a peak: cut to the smallest step, status 3, and the rows up to there.
TEST_F(Follow, StressControlEndsAtThePeak) {
  Case c;
  c.material.type = MaterialType::von_mises;
  c.material.young = 1000;
  c.material.yield_stress = 6;
  c.material.hardening = -40;
  c.solver = tight();
  PathSegment up = free_but(only(xx, kNotGiven), 10);
  up.stress[yy] = 8;
  c.path = {up};
  EXPECT_EQ(follow_path(c, *make_analytic_point(c), options), kNotConverged);
  EXPECT_NEAR(column("stress_yy").back(), 6, 0.01);
  EXPECT_NE(text("log.txt").find("rejected"), std::string::npos);
  EXPECT_NE(text("summary.json").find("along segment 1"), std::string::npos);
}

TEST_F(Follow, AFailingPointEndsWithItsSentence) {
  Case c;
  c.solver = tight();
  PathSegment down;
  down.strain[yy] = -0.1;
  down.increments = 4;
  c.path = {down};
  AnalyticPoints point({FailingLaw{1000, 0.25, 0.06}});
  EXPECT_EQ(follow_path(c, point, options), kPointFailed);
  EXPECT_NEAR(column("F_22").back(), 0.94, 1e-4);
}

}  // namespace
}  // namespace femxdem
