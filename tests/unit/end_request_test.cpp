#include "end_request.hpp"

#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <ctime>

#include "errors.hpp"

namespace femxdem {
namespace {

Moment in_seconds(double seconds) {
  return Moment::clock::now() + std::chrono::duration_cast<Moment::duration>(std::chrono::duration<double>(seconds));
}

TEST(EndRequest, DurationsAsSchedulersWriteThem) {
  EXPECT_EQ(seconds_of("90"), 90);
  EXPECT_EQ(seconds_of("2:05"), 125);
  EXPECT_EQ(seconds_of("01:00:05"), 3605);
  EXPECT_EQ(seconds_of("2-12"), 60 * 3600);
  EXPECT_EQ(seconds_of("1-00:30:00"), 86400 + 1800);
  for (const char* wrong : {"", "1h", "1:", ":30", "-5", "1:2:3:4", "1-2-3", "1e3", "12:30-4"})
    EXPECT_THROW(seconds_of(wrong), UserError) << wrong;
}

TEST(EndRequest, ASignalIsRememberedByItsName) {
  for (const auto& [number, name] : {std::pair{SIGTERM, "SIGTERM"}, {SIGUSR1, "SIGUSR1"}, {SIGINT, "SIGINT"}}) {
    const EndRequest request(std::nullopt);
    EXPECT_FALSE(request.reason(1e9));
    std::raise(number);
    std::raise(SIGTERM);  // schedulers repeat themselves
    EXPECT_EQ(request.reason(0), name);
  }
}

TEST(EndRequest, ASignalAfterTheRunDoesNotChangeItsStatus) {
  EXPECT_EXIT(
      {
        EndRequest(std::nullopt);
        std::raise(SIGINT);
        std::exit(0);
      },
      testing::ExitedWithCode(0), "");
}

TEST(EndRequest, TimeIsOverWhenLessThanNeededIsLeft) {
  const EndRequest request(in_seconds(100));
  EXPECT_FALSE(request.reason(90));
  ASSERT_TRUE(request.reason(101));
  EXPECT_NE(request.reason(101)->find("s of its time are left"), std::string::npos);
  EXPECT_TRUE(EndRequest(in_seconds(-5)).reason(0));
}

TEST(EndRequest, IgnoredSignalsStayIgnored) {
  std::signal(SIGHUP, SIG_IGN);  // nohup
  {
    const EndRequest request(std::nullopt);
    std::raise(SIGHUP);
    EXPECT_FALSE(request.reason(0));
  }
  std::signal(SIGHUP, SIG_DFL);
}

TEST(EndRequest, ASecondInterruptEndsAtOnce) {
  EXPECT_EXIT(
      {
        const EndRequest request(std::nullopt);
        std::raise(SIGINT);
        std::raise(SIGINT);
      },
      testing::KilledBySignal(SIGINT), "");
}

TEST(EndRequest, BeforeThereIsAnythingToSaveASignalEndsTheProcess) {
  EXPECT_EXIT((end_at_signals(), std::raise(SIGUSR1)), testing::ExitedWithCode(kRunAgain), "told to end; run again");
  EXPECT_EXIT((end_at_signals(), std::raise(SIGINT)), testing::KilledBySignal(SIGINT), "");
}

TEST(EndRequest, SlurmTellsTheEndOfTheJob) {
  EXPECT_FALSE(end_of_job());
  setenv("SLURM_JOB_END_TIME", std::to_string(std::time(nullptr) + 50).c_str(), 1);
  const auto end = end_of_job();
  unsetenv("SLURM_JOB_END_TIME");
  ASSERT_TRUE(end);
  EXPECT_NEAR(std::chrono::duration<double>(*end - Moment::clock::now()).count(), 50, 1.5);
}

}  // namespace
}  // namespace femxdem
