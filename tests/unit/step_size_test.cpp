#include "step_size.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace femxdem {
namespace {

/// Ways from 0 to 1 with steps that `fails` tells from their size.
template <class Fails>
std::vector<double> walk(StepSize size, Fails fails) {
  std::vector<double> steps;
  double at = 0;
  while (!size.done(at)) {
    const double step = size.next(at);
    if (fails(at, step)) {
      size.rejected();
      if (size.exhausted()) break;
      continue;
    }
    at += step;
    steps.push_back(step);
    size.accepted(true);
  }
  return steps;
}

const auto kNever = [](double, double) { return false; };

TEST(StepSize, GrowsToItsLargestAndEndsAtTheEnd) {
  const std::vector<double> steps = walk(StepSize({0.1, 0.01, 0.2, 1.5, 0.5}, 1), kNever);
  ASSERT_GE(steps.size(), 4U);
  EXPECT_EQ(steps[0], 0.1);
  EXPECT_NEAR(steps[1], 0.15, 1e-15);
  EXPECT_NEAR(steps[2], 0.2, 1e-15);
  double sum = 0;
  for (const double step : steps) sum += step;
  EXPECT_EQ(sum, 1);
}

TEST(StepSize, LeavesNoCrumb) {
  const std::vector<double> steps = walk(StepSize({0.45, 0.01, 0.45, 1, 0.5}, 1), kNever);
  ASSERT_EQ(steps.size(), 3U) << "after 0.45 a second one would leave 0.1: half of what is left, twice";
  EXPECT_NEAR(steps[1], 0.275, 1e-15);
  EXPECT_NEAR(steps[2], 0.275, 1e-15);
}

TEST(StepSize, IsCutUntilExhausted) {
  EXPECT_TRUE(walk(StepSize({0.1, 0.01, 0.1, 1.5, 0.5}, 1), [](double at, double) { return at > 0.45; }).size() < 8);
  StepSize size({0.1, 0.03, 0.1, 1.5, 0.5}, 1);
  size.next(0);
  size.rejected();
  EXPECT_EQ(size.size(), 0.05);
  EXPECT_FALSE(size.exhausted());
  size.next(0);
  size.rejected();
  EXPECT_TRUE(size.exhausted());
}

TEST(StepSize, ASlowStepKeepsItsSizeAndOneTriedAgainToo) {
  StepSize size({0.1, 0.01, 1, 1.5, 0.5}, 1);
  size.next(0);
  size.accepted(false);
  EXPECT_EQ(size.size(), 0.1);
  size.next(0.1);
  size.again();
  EXPECT_EQ(size.size(), 0.1);
}

}  // namespace
}  // namespace femxdem
