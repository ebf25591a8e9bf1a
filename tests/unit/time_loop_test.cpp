#include "time_loop.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "analytic_points.hpp"
#include "own_folder.hpp"

namespace femxdem {
namespace {

/// A square block compressed by 1 %, on a law that fails beyond a strain or on elasticity.
Case block(double end_time = 1) {
  Case c;
  c.file = "block.toml";
  c.mesh = {.width = 1, .height = 1, .nx = 2, .ny = 2, .file = {}};
  c.material.type = MaterialType::elastic;
  c.material.young = 1000;
  const auto hold = [&](const char* edge, Component component, double value) {
    c.loads.push_back({.edge = edge, .point = {}, .component = component, .value = value, .table = {}});
  };
  hold("bottom", Component::y, 0);
  hold("left", Component::x, 0);
  hold("top", Component::y, -0.01);
  c.control = {.end_time = end_time,
               .step = 0.1,
               .min_step = 0.01,
               .max_step = 0.3,
               .loads = {},
               .measure_edge = {},
               .against_edge = {}};
  c.monitors = {{"force", Quantity::reaction_y, "top", {}}};
  return c;
}

const VonMisesLaw kHardening{1000, 0.25, 2, 50, 0, 0};

/// The same sheared by 2 %, for kHardening and learned tangents, with a checkpoint every four steps.
Case sheared_block(double displacement_tolerance) {
  Case c = block();
  c.solver.tolerance = 1e-3;
  c.solver.displacement_tolerance = displacement_tolerance;
  c.output.checkpoint_every = 4;
  c.loads.back().component = Component::x;
  c.loads.back().value = 0.02;
  return c;
}

std::string text_of(const std::filesystem::path& file) { return read_file(file); }

/// Rows of history.csv without the columns of the clock.
std::vector<std::string> rows(const std::filesystem::path& folder) {
  std::istringstream text(text_of(folder / "history.csv"));
  std::vector<std::string> rows;
  for (std::string line; std::getline(text, line);) {
    for (int clock = 0; clock < 2; ++clock) line.resize(line.rfind(','));
    rows.push_back(line);
  }
  return rows;
}

class TimeLoopTest : public OwnFolder {
 protected:
  int run(const Case& c, const AnalyticLaw& law, Existing existing = Existing::refuse) {
    Problem problem(c);
    AnalyticPoints points(std::vector<AnalyticLaw>(problem.formulation().points(), law));
    RunOptions options;
    options.folder = folder_;
    options.existing = existing;
    return run_case(problem, points, options);
  }
};

TEST_F(TimeLoopTest, RunsToTheEndAndWritesEverything) {
  const Case c = block();
  EXPECT_EQ(run(c, make_law(c.material)), kDone);
  for (const char* name : {"history.csv", "results.h5", "results.xdmf", "summary.json", "case.toml", "log.txt"})
    EXPECT_TRUE(std::filesystem::exists(folder_ / name)) << name;
  const auto lines = rows(folder_);
  EXPECT_NE(lines.back().find(",1,1,"), std::string::npos) << "time and load factor of the last step: " << lines.back();
  EXPECT_NE(text_of(folder_ / "summary.json").find("\"status\": \"done\""), std::string::npos);
}

TEST_F(TimeLoopTest, APointThatFailsCutsTheStepAndKeepsWhatConverged) {
  Case c = block();
  EXPECT_EQ(run(c, FailingLaw{1000, 0.25, 0.004}), kPointFailed);
  EXPECT_GE(rows(folder_).size(), 3U);
  EXPECT_NE(text_of(folder_ / "log.txt").find("rejected"), std::string::npos);
  EXPECT_NE(text_of(folder_ / "summary.json").find("\"exit_status\": 4"), std::string::npos);
}

TEST_F(TimeLoopTest, ARestartEqualsTheUninterruptedRun) {
  Case c = block();
  c.output.checkpoint_every = 4;  // of six steps
  ASSERT_EQ(run(c, make_law(c.material)), kDone);
  const auto whole = rows(folder_);
  EXPECT_EQ(run(c, make_law(c.material), Existing::resume), kDone) << "from its last checkpoint";
  EXPECT_EQ(rows(folder_), whole);
}

TEST_F(TimeLoopTest, ReusedAnswersAreCountedAndARestartGoesOnWithThem) {
  Case c = sheared_block(0.1);
  c.solver.reuse_below = 0.5;
  ASSERT_EQ(run(c, kHardening), kDone);
  const auto whole = rows(folder_);
  EXPECT_TRUE(whole.front().ends_with(",reused,reuse_error")) << whole.front();
  const std::string log = text_of(folder_ / "log.txt");
  EXPECT_NE(log.find(" % of the answers from learned tangents, their error at most "), std::string::npos);
  EXPECT_EQ(log.find("; 0.0 % of the answers"), std::string::npos) << "some were reused";
  EXPECT_EQ(run(c, kHardening, Existing::resume), kDone);
  EXPECT_EQ(rows(folder_), whole);
}

TEST_F(TimeLoopTest, LearnedEndsAreCountedAndARestartGoesOnWithThem) {
  Case c = sheared_block(0.3);
  c.solver.last_correction = LastCorrection::learned;
  ASSERT_EQ(run(c, kHardening), kDone);
  const auto whole = rows(folder_);
  EXPECT_TRUE(whole.front().ends_with(",learned_end")) << whole.front();
  const long learned = std::count_if(whole.begin(), whole.end(), [](const auto& row) { return row.ends_with(",1"); });
  EXPECT_GT(learned, 0);
  EXPECT_NE(text_of(folder_ / "log.txt").find(fmt::format("; the last correction of {} of them by", learned)),
            std::string::npos);
  EXPECT_EQ(run(c, kHardening, Existing::resume), kDone);
  EXPECT_EQ(rows(folder_), whole);
}

TEST_F(TimeLoopTest, ResultsAreNotOverwrittenUnasked) {
  const Case c = block();
  ASSERT_EQ(run(c, make_law(c.material)), kDone);
  EXPECT_THROW(run(c, make_law(c.material)), UserError);
}

}  // namespace
}  // namespace femxdem
