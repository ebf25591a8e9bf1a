#include "acceleration.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "convergence.hpp"

namespace femxdem {
namespace {

/// A linear problem A z = b with a poor operator, the identity: corrections d = b - A z.
struct Linear {
  Eigen::MatrixXd A;
  Eigen::VectorXd b;
  Eigen::VectorXd correction(const Eigen::VectorXd& z) const { return b - A * z; }
};

Linear linear_problem(int n) {
  Linear problem{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Ones(n)};
  for (int i = 0; i < n; ++i) {
    problem.A(i, i) = 1 + 0.9 * i / (n - 1);  // spectral radius 0.9 of I - A
    if (i > 0) problem.A(i, i - 1) = 0.2;
  }
  return problem;
}

int iterations(const Linear& problem, int depth, double truncation, double tolerance) {
  const Eigen::Index n = problem.b.size();
  AndersonAcceleration anderson(depth, truncation, Eigen::VectorXd::Ones(n));
  Eigen::VectorXd z = Eigen::VectorXd::Zero(n);
  for (int i = 0; i < 500; ++i) {
    const Eigen::VectorXd d = problem.correction(z);
    if (d.norm() < tolerance) return i;
    z += anderson.change(z, d);
  }
  return 500;
}

// With as many columns as unknowns, Anderson's method is GMRES on a linear problem: exact after n + 1 corrections.
TEST(Anderson, SolvesALinearProblemInAsManyStepsAsUnknowns) {
  const Linear problem = linear_problem(6);
  EXPECT_LE(iterations(problem, 6, 0, 1e-10), 8);
  EXPECT_GT(iterations(problem, 0, 0, 1e-10), 50) << "the plain iteration";
}

TEST(Anderson, DepthZeroReturnsTheCorrection) {
  AndersonAcceleration plain(0, 0, Eigen::VectorXd::Ones(2));
  EXPECT_EQ(plain.change(Eigen::Vector2d(1, 2), Eigen::Vector2d(3, 4)), Eigen::VectorXd(Eigen::Vector2d(3, 4)));
  EXPECT_EQ(plain.change(Eigen::Vector2d(2, 2), Eigen::Vector2d(1, 1)), Eigen::VectorXd(Eigen::Vector2d(1, 1)));
}

TEST(Anderson, DropsColumnsThatSayNothingNew) {
  AndersonAcceleration anderson(3, 1e-2, Eigen::VectorXd::Ones(2));
  anderson.change(Eigen::Vector2d(0, 0), Eigen::Vector2d(1, 0));
  anderson.change(Eigen::Vector2d(1, 0), Eigen::Vector2d(0.5, 0));
  // The third pair repeats the second: its column is zero, so that only the correction itself is left.
  EXPECT_EQ(anderson.change(Eigen::Vector2d(1, 0), Eigen::Vector2d(0.5, 0)), Eigen::VectorXd(Eigen::Vector2d(0.5, 0)));
}

TEST(Anderson, ComponentsOfWeightZeroFollow) {
  AndersonAcceleration anderson(1, 0, Eigen::Vector2d(1, 0));
  anderson.change(Eigen::Vector2d(0, 0), Eigen::Vector2d(1, 5));
  // d1 falls from 1 to 0.5 as z1 goes from 0 to 1: it vanishes at z1 = 2; z2 is mixed with the same coefficient, -1.
  const Eigen::VectorXd change = anderson.change(Eigen::Vector2d(1, 5), Eigen::Vector2d(0.5, 7));
  EXPECT_NEAR(change[0], 1, 1e-14);
  EXPECT_NEAR(change[1], 7 + 5 + 2, 1e-14);
}

TEST(LineSearch, FindsTheLeastOfAParabolaAndKeepsItsBounds) {
  LineSearch search(1);
  EXPECT_FALSE(search.rejects(1e9)) << "nothing to compare with before the first change";
  search.start(1);
  EXPECT_FALSE(search.rejects(0.9));
  search.start(1);
  // phi(s) = 1 - 2 s + k s^2 has phi(1) = 3 for k = 4 and its least value at s = 1/4.
  EXPECT_TRUE(search.rejects(std::sqrt(3.0)));
  EXPECT_NEAR(search.fraction(), 0.25, 1e-14);
  EXPECT_FALSE(search.rejects(0.8));
  search.start(1);
  EXPECT_TRUE(search.rejects(100));
  EXPECT_NEAR(search.fraction(), 0.1, 1e-14);
  EXPECT_TRUE(search.rejects(100));
  EXPECT_TRUE(search.rejects(100));
  EXPECT_FALSE(search.rejects(100)) << "three times at most";
}

ResidualHistory history(const std::vector<double>& residuals, double tolerance = 1e-3) {
  ResidualHistory h(tolerance);
  for (const double r : residuals) h.add(r);
  return h;
}

TEST(ResidualHistory, NamesWhatHappened) {
  const auto starts = [](const std::string& text, const std::string& word) { return text.rfind(word, 0) == 0; };
  EXPECT_PRED2(starts, history({1, 0.5, 0.3, 0.2, 0.14, 0.1, 0.07, 0.05}).verdict(), "converges too slowly");
  EXPECT_PRED2(starts, history({1, 0.1, 0.05, 0.049, 0.0485, 0.048, 0.0475, 0.047, 0.0465}).verdict(), "stagnates");
  EXPECT_PRED2(starts, history({1, 0.1, 0.05, 0.3, 0.05, 0.3, 0.05, 0.3, 0.05, 0.3}).verdict(), "oscillates");
  EXPECT_PRED2(starts, history({1, 0.1, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6}).verdict(), "diverges");
}

// Histories of steps that went on to converge must not be stopped: the residual of the second one grew 33 times.
TEST(ResidualHistory, StopsOnlyWhatCannotConverge) {
  EXPECT_EQ(history({0.02, 0.3, 0.66, 0.1, 0.03}).hopeless(true), "");
  EXPECT_EQ(history({1e-4, 0.6}).hopeless(true), "") << "a good start that is lost: the tolerance counts too";
  EXPECT_NE(history({0.02, 0.3, 0.66, 21}).hopeless(true), "");
  EXPECT_NE(history({0.02, std::nan("")}).hopeless(true), "");
  const std::vector<double> cycle = {0.4, 0.3, 0.1, 0.3, 0.1, 0.3};
  EXPECT_NE(history(cycle).hopeless(true), "");
  EXPECT_EQ(history(cycle).hopeless(false), "") << "an operator that learns may leave the cycle";
  EXPECT_EQ(history({0.4, 0.3, 0.1, 0.2, 0.1, 0.3}).hopeless(true), "");
}

}  // namespace
}  // namespace femxdem
