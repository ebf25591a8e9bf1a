#include "python_volume_elements.hpp"

#include <signal.h>
#include <unistd.h>

#include <thread>

#include "../material_points_contract.hpp"
#include "errors.hpp"
#include "processes.hpp"

namespace femxdem {
namespace {

using contract::expect_same_bits;
using contract::gradients;
using contract::part;

WorkerCommand dummy(const std::string& engine = "dummy_engine:DummyEngine") {
  WorkerCommand command;
  command.engine = engine;
  command.python_path = TEST_ENGINES;
  return command;
}

/// Volume elements on a worker of their own; `states` are made from the specifications, one point each.
struct Points {
  explicit Points(const std::vector<std::string>& specifications, const WorkerCommand& command = dummy(),
                  VolumeElementOptions options = {})
      : worker(command), points(worker, std::move(options)) {
    for (const std::string& specification : specifications) points.add(points.make_template(specification).state, 1);
  }
  WorkerProcess worker;
  PythonVolumeElements points;
};

const std::string kPlain = "{}";
const std::vector<std::string> kThree = {kPlain, R"({"poisson_ratio": 0.1})", R"({"youngs_modulus": 3e7})"};

VolumeElementOptions serialised() {
  VolumeElementOptions options;
  options.serialise = true;
  return options;
}

TEST(PythonVolumeElements, ContractWithFork) {
  Points three(kThree);
  contract::check_local(three.points, {});
}

TEST(PythonVolumeElements, ContractWithSerialising) {
  Points three(kThree, dummy(), serialised());
  contract::check_local(three.points, {});
}

TEST(PythonVolumeElements, ForkAndSerialisingGiveTheSameBits) {
  Points forked(kThree), saved(kThree, dummy(), serialised());
  const auto F = gradients(3, 1e-3);
  for (const double fraction : {0.2, 0.5, 0.4, 1.0}) {
    expect_same_bits(contract::trial(forked.points, part(F, fraction)),
                     contract::trial(saved.points, part(F, fraction)));
    forked.points.commit();
    saved.points.commit();
  }
}

TEST(PythonVolumeElements, WhereForkIsRefusedItSerialisesAndSaysSoOnce) {
  Points forked({kPlain, kPlain, kPlain});
  std::vector<std::string> said;
  VolumeElementOptions options;
  options.say = [&](std::string_view line) { said.emplace_back(line); };
  WorkerProcess worker(dummy("slow_engine:UnforkableEngine"));
  PythonVolumeElements unforkable(worker, options);
  EXPECT_THROW(unforkable.make_template(kPlain), UserError);
  unforkable.add(forked.points.save()[0], 3);
  contract::check_local(unforkable, {});
  const auto F = gradients(3, 1e-3);
  expect_same_bits(contract::trial(unforkable, F), contract::trial(forked.points, F));
  ASSERT_EQ(said.size(), 1U);
  EXPECT_NE(said[0].find("fork was refused"), std::string::npos) << said[0];
}

TEST(PythonVolumeElements, ElasticStressOfTheDummyCell) {
  // sigma = R (C : (U - I) - p I) R^T with E = 1e8, nu = 0.25, p = 1e5: lambda = mu = 4e7
  Points one({kPlain});
  Tensor2 F = Tensor2::Identity();
  F(0, 0) = 1.001;
  const Response response = one.points.evaluate(std::vector{F}, Operator::elastic)[0];
  ASSERT_FALSE(response.failure) << response.failure->sentence;
  EXPECT_NEAR(response.stress(0, 0), 1.2e5 - 1e5, 1e-6);
  EXPECT_NEAR(response.stress(1, 1), 4e4 - 1e5, 1e-6);
  EXPECT_LE((response.stiffness - isotropic_stiffness(4e7, 4e7)).norm(), 1e-3);
  // rate = I / time_scale = 5e-3 / 1e-3, dt = 1e-5: 5e-5 a step; |ln U| = ln 1.001 = 9.995e-4: 20 steps
  EXPECT_EQ(response.report["dem_steps"], 20);
}

VolumeElementOptions mean_at(double theta) {
  VolumeElementOptions options;
  options.answer_at = theta;
  return options;
}

/// The stress of the dummy cell is linear in the stretch: the mean over a trial is that of the stretch at answer_at, to
/// second order in the strain, turned by the rotation of the end; a trial of no step answers with the stress of its
/// end.
TEST(PythonVolumeElements, MeanStressOfTheDummyCell) {
  Tensor2 U = Tensor2::Identity(), Q;
  U(0, 0) = 1.001;
  Q << 0.8, -0.6, 0, 0.6, 0.8, 0, 0, 0, 1;
  for (const double theta : {0.5, 0.6, 0.6666}) {
    Points one({kPlain}, dummy(), mean_at(theta));
    Response response = one.points.evaluate(std::vector{Tensor2(Q * U)}, Operator::none)[0];
    ASSERT_FALSE(response.failure) << response.failure->sentence;
    const Tensor2 s = Q.transpose() * response.stress * Q;
    EXPECT_NEAR(s(0, 0), theta * 1.2e5 - 1e5, 1.2e8 * 1e-6 / 4);
    EXPECT_NEAR(s(1, 1), theta * 4e4 - 1e5, 4e7 * 1e-6 / 4);
    response = one.points.evaluate(std::vector{Tensor2(Tensor2::Identity())}, Operator::none)[0];
    EXPECT_EQ(response.report["dem_steps"], 0);
    EXPECT_NEAR(response.stress(0, 0), -1e5, 1e-6);
  }
}

TEST(PythonVolumeElements, MeanStressHasTheSameBitsAfterASaveAndALoad) {
  Points whole(kThree, dummy(), mean_at(0.5)), other(kThree, dummy(), mean_at(0.5));
  const auto F = gradients(3, 1e-3);
  contract::trial(whole.points, part(F, 0.5));
  whole.points.commit();
  other.points.load(whole.points.save());
  expect_same_bits(contract::trial(whole.points, F), contract::trial(other.points, F));
}

/// The dummy's mean rotation stands for what costs too much to be reported by every trial: |F - I| of its cell.
TEST(PythonVolumeElements, ReportsAreCompleteOnceTheyAreCommitted) {
  for (const VolumeElementOptions& options : {VolumeElementOptions{}, serialised()}) {
    Points three(kThree, dummy(), options);
    for (const double strain : {1e-3, 2e-3}) {
      Tensor2 F = Tensor2::Identity();
      F(1, 1) += strain;
      const std::vector<Tensor2> all{F, Tensor2::Identity(), F};
      std::vector<Response> responses = three.points.evaluate(all, Operator::none);
      const std::vector<Response> trial = responses;
      for (const Response& r : trial) EXPECT_TRUE(std::isnan(r.report["mean_rotation"]));
      three.points.commit();
      complete_reports(three.points, responses);
      for (std::size_t i = 0; i < 3; ++i) {
        PointReport report = trial[i].report;
        report["mean_rotation"] = responses[i].report["mean_rotation"];
        EXPECT_EQ(report.values, responses[i].report.values) << "only what was missing has changed";
        EXPECT_NEAR(report["mean_rotation"], (all[i] - Tensor2::Identity()).norm(), 1e-12);
      }
    }
  }
}

TEST(PythonVolumeElements, StepsAreFrozenWithinALoadStep) {
  Points one({kPlain});
  const auto steps = [&](double strain) {
    Tensor2 F = Tensor2::Identity();
    F(1, 1) += strain;
    return one.points.evaluate(std::vector{F}, Operator::none)[0].report["dem_steps"];
  };
  EXPECT_EQ(steps(1e-3), 20);
  EXPECT_EQ(steps(1.5e-3), 20);
  EXPECT_EQ(steps(1e-6), 20);
  EXPECT_EQ(steps(3e-3), 60) << "more than twice as many are needed";
  one.points.begin_step();
  EXPECT_EQ(steps(1e-6), 10) << "min_steps";
}

TEST(PythonVolumeElements, TimeStepFollowsTheNetworkAtCommitsThatLeaveAClass) {
  // pressure 1e5 + K (1 - F_11), K = 6.67e7: 1.07e5 lies in the class of 2^16 to 2^17, 1.67e5 does not
  for (const VolumeElementOptions& options : {VolumeElementOptions{}, serialised()}) {
    Points one({kPlain}, dummy(), options);
    Tensor2 near = Tensor2::Identity(), far = Tensor2::Identity(), further = Tensor2::Identity();
    near(0, 0) -= 1e-4;
    far(0, 0) -= 1e-3;
    further(0, 0) -= 2e-3;
    const auto steps = [&](const Tensor2& F) {
      const Response response = one.points.evaluate(std::vector{F}, Operator::none)[0];
      EXPECT_FALSE(response.failure);
      return response.report["dem_steps"];
    };
    EXPECT_EQ(steps(far), 21) << "a trial that is given up";
    steps(near);
    one.points.commit();
    EXPECT_EQ(one.points.info(0).time_step, 1e-5);
    EXPECT_EQ(steps(far), 19);
    one.points.commit();
    EXPECT_EQ(one.points.info(0).time_step, 5e-6);
    EXPECT_EQ(steps(further), 41);
    const SavedStates states = one.points.save();
    EXPECT_EQ(one.points.info(0).time_step, 5e-6);
    one.points.load(states);
    EXPECT_EQ(one.points.info(0).time_step, 5e-6);
  }
}

TEST(PythonVolumeElements, AnEngineThatRaisesIsAFailureOfItsPoint) {
  Points three({kPlain, R"({"fault": "raise", "fault_strain": 5e-4})", kPlain});
  const auto responses = three.points.evaluate(gradients(3, 1e-3), Operator::none);
  EXPECT_FALSE(responses[0].failure);
  EXPECT_FALSE(responses[2].failure);
  ASSERT_TRUE(responses[1].failure);
  EXPECT_EQ(responses[1].failure->point, 1U);
  EXPECT_EQ(responses[1].failure->sentence, "dummy cell 1 failed on purpose (fault = raise); choose a smaller step.");
  EXPECT_THROW(three.points.commit(), std::logic_error);
  const auto smaller = three.points.evaluate(gradients(3, 1e-4), Operator::none);
  for (const Response& response : smaller) EXPECT_FALSE(response.failure);
  three.points.commit();
}

TEST(PythonVolumeElements, APointThatAlwaysCrashesFailsAlone) {
  Points four(
      {kPlain, R"({"fault": "segv", "fault_strain": 5e-4})", kPlain, R"({"fault": "segv", "fault_strain": 5e-4})"});
  Points healthy({kPlain, kPlain, kPlain, kPlain});
  const auto F = gradients(4, 1e-3);
  const auto responses = four.points.evaluate(F, Operator::none);
  const auto expected = healthy.points.evaluate(F, Operator::none);
  for (const std::size_t i : {0U, 2U}) {
    ASSERT_FALSE(responses[i].failure);
    EXPECT_TRUE(contract::same_bits(responses[i].stress, expected[i].stress));
  }
  for (const std::size_t i : {1U, 3U}) {
    ASSERT_TRUE(responses[i].failure);
    EXPECT_EQ(responses[i].failure->point, i);
    EXPECT_NE(responses[i].failure->sentence.find("signal 11"), std::string::npos) << responses[i].failure->sentence;
  }
}

TEST(PythonVolumeElements, APointThatHangsFailsAlone) {
  WorkerCommand command = dummy();
  command.point_timeout = 2;
  Points three({kPlain, R"({"fault": "hang", "fault_strain": 5e-4})", kPlain}, command);
  const auto responses = three.points.evaluate(gradients(3, 1e-3), Operator::none);
  EXPECT_FALSE(responses[0].failure);
  EXPECT_FALSE(responses[2].failure);
  ASSERT_TRUE(responses[1].failure);
  EXPECT_NE(responses[1].failure->sentence.find("signal 9"), std::string::npos) << responses[1].failure->sentence;
}

TEST(PythonVolumeElements, KillingTheTrialChangesNothing) {
  Points disturbed({kPlain, kPlain, kPlain}, dummy("slow_engine:SlowEngine"));
  Points undisturbed({kPlain, kPlain, kPlain});
  const auto F = gradients(3, 1e-3);
  for (const double fraction : {0.5, 1.0}) {
    bool killed = false;
    std::thread killer([&] {
      killed = processes::within(2, [&] { return disturbed.worker.in_flight() == 1U; }) &&
               kill(static_cast<pid_t>(disturbed.worker.child()), SIGSEGV) == 0;
    });
    const auto responses = contract::trial(disturbed.points, part(F, fraction));
    killer.join();
    EXPECT_TRUE(killed);
    expect_same_bits(responses, contract::trial(undisturbed.points, part(F, fraction)));
    disturbed.points.commit();
    undisturbed.points.commit();
  }
}

TEST(PythonVolumeElements, KillingTheTrialThatWaitsChangesNothing) {
  Points disturbed(kThree), undisturbed(kThree);
  const auto F = gradients(3, 1e-3);
  for (Points* points : {&disturbed, &undisturbed}) contract::trial(points->points, part(F, 0.5));
  const auto trial = static_cast<pid_t>(disturbed.worker.child());
  ASSERT_GT(trial, 0);
  ASSERT_EQ(kill(trial, SIGSEGV), 0);
  ASSERT_TRUE(processes::within(2, [&] { return !processes::alive(trial); }));
  for (Points* points : {&disturbed, &undisturbed}) points->points.commit();
  expect_same_bits(contract::trial(disturbed.points, F), contract::trial(undisturbed.points, F));
  // and once more, followed by another trial
  kill(static_cast<pid_t>(disturbed.worker.child()), SIGSEGV);
  expect_same_bits(contract::trial(disturbed.points, F), contract::trial(undisturbed.points, F));
}

TEST(PythonVolumeElements, FiftyCommitsLeaveNoProcessBehind) {
  {
    Points three(kThree);
    const auto F = gradients(3, 1e-3);
    for (int k = 1; k <= 50; ++k) {
      three.points.evaluate(part(F, 0.02 * k), Operator::none);
      three.points.evaluate(part(F, 0.02 * k), Operator::none);
      three.points.commit();
    }
    three.points.evaluate(F, Operator::none);
    three.points.versions();  // reaps
    EXPECT_LE(processes::children(getpid(), 'Z'), 1);
    EXPECT_LE(processes::children(getpid()), 2);
    EXPECT_EQ(processes::children(three.worker.pid()), 0);
    EXPECT_GT(three.points.peak_memory(), 1U << 20);
  }
  EXPECT_EQ(processes::children(getpid()), 0) << "the worker outlived its rank's end";
}

TEST(PythonVolumeElements, WorkersDieWithTheirRank) {
  for (const bool in_evaluation : {false, true}) {
    int ends[2];
    ASSERT_EQ(pipe(ends), 0);
    const pid_t rank = fork();
    if (rank == 0) {
      Points three({kPlain, kPlain, kPlain}, dummy("slow_engine:SlowEngine"));
      const auto F = gradients(3, 1e-3);
      contract::trial(three.points, part(F, 0.5));
      three.points.commit();
      std::thread tell([&] {
        if (in_evaluation) processes::within(2, [&] { return three.worker.in_flight() == 1U; });
        const pid_t pids[2] = {three.worker.pid(), static_cast<pid_t>(three.worker.child())};
        if (write(ends[1], pids, sizeof pids) != sizeof pids) _exit(1);
      });
      if (!in_evaluation) tell.join();
      if (in_evaluation) contract::trial(three.points, F);
      pause();
      _exit(0);
    }
    pid_t pids[2] = {0, 0};
    ASSERT_EQ(read(ends[0], pids, sizeof pids), static_cast<ssize_t>(sizeof pids));
    ASSERT_TRUE(processes::alive(pids[0]));
    ASSERT_EQ(processes::alive(pids[1]), in_evaluation);
    kill(rank, SIGKILL);
    EXPECT_TRUE(processes::within(2, [&] { return !processes::alive(pids[0]); })) << "committed process";
    EXPECT_TRUE(processes::within(2, [&] { return !processes::alive(pids[1]); })) << "trial process";
    for (const int end : ends) close(end);
  }
}

TEST(PythonVolumeElements, ALostWorkerIsSaid) {
  Points three(kThree);
  kill(three.worker.pid(), SIGKILL);
  EXPECT_THROW(three.points.evaluate(gradients(3, 1e-3), Operator::none), WorkerLost);
}

TEST(PythonVolumeElements, TemplatesThatFailAreUsersMistakes) {
  WorkerCommand command = dummy("slow_engine:TemplateEngine");
  command.template_timeout = 1;
  WorkerProcess worker(command);
  PythonVolumeElements points(worker, {});
  const auto sentence = [&](const std::string& script) -> std::string {
    try {
      points.make_template(R"({"script": ")" + script + R"("})");
    } catch (const UserError& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_EQ(sentence("mistake"), "script theirs.py, line 3: no periodic cell; set O.periodic = True.");
  EXPECT_NE(sentence("crash").find("signal 11"), std::string::npos);
  EXPECT_NE(sentence("alarm").find("script is within a call that cannot be interrupted"), std::string::npos);
  EXPECT_NE(sentence("endless").find("signal 9"), std::string::npos);
  EXPECT_EQ(points.make_template(kPlain).manifest, R"({"source": "dummy"})");
}

TEST(PythonVolumeElements, AnEngineThatCannotStartIsSaid) {
  const auto sentence = [](const std::string& engine) -> std::string {
    WorkerProcess worker(dummy(engine));
    try {
      PythonVolumeElements(worker, {}).versions();
    } catch (const UserError& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_EQ(sentence("slow_engine:BrokenEngine"), "YADE's modules were not found in /nowhere; set FEMXDEM_YADE_DIR.");
  EXPECT_EQ(sentence("no_such_module:Engine"), "ModuleNotFoundError: No module named 'no_such_module'");
  EXPECT_EQ(sentence("Engine"), "engine 'Engine': expected module:class, such as volume_element:Engine");
}

TEST(PythonVolumeElements, RefusesWhatItCannotDo) {
  Points three(kThree);
  EXPECT_THROW(three.points.evaluate(gradients(3, 1e-3), Operator::tangent), UserError);
  EXPECT_THROW(three.points.load({"only one"}), UserError);
  EXPECT_THROW(three.points.commit(), std::logic_error);
  const auto far = three.points.evaluate(gradients(3, 0.5), Operator::none);
  ASSERT_TRUE(far[0].failure);
  EXPECT_NE(far[0].failure->sentence.find("strain increment"), std::string::npos);
}

TEST(PythonVolumeElements, TheWorkersEnvironmentIsItsOwn) {
  setenv("OMPI_COMM_WORLD_SIZE", "2", 1);
  setenv("PMIX_RANK", "1", 1);
  setenv("OMP_NUM_THREADS", "7", 1);
  Points one({kPlain});
  one.points.versions();
  std::ifstream file("/proc/" + std::to_string(one.worker.pid()) + "/environ");
  const std::string environment((std::istreambuf_iterator<char>(file)), {});
  EXPECT_EQ(environment.find("OMPI_"), std::string::npos);
  EXPECT_EQ(environment.find("PMIX_"), std::string::npos);
  EXPECT_EQ(environment.find("OMP_NUM_THREADS=7"), std::string::npos);
  EXPECT_NE(environment.find("OMP_NUM_THREADS=1"), std::string::npos);
}

}  // namespace
}  // namespace femxdem
