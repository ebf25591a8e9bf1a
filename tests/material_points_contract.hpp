#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <vector>

#include "material_points.hpp"

/// What every implementation of MaterialPoints has to keep, as one body of tests (fe_master/material_points.hpp).
namespace femxdem::contract {

struct Tolerances {
  double strain = 1e-3;  ///< size of the trials [-]
  double path = 1e-12;   ///< one path in two steps against one step, relative to the stress
  /// Rotated against unrotated, relative to the stress: a stress of E times the strain inherits E times the round-off
  /// of F and of its polar decomposition, some 20 eps.
  double rotation = 20 * std::numeric_limits<double>::epsilon() / strain;
};

inline bool same_bits(const Tensor2& a, const Tensor2& b) { return std::memcmp(a.data(), b.data(), sizeof a) == 0; }
inline bool same_bits(const Tensor4& a, const Tensor4& b) { return std::memcmp(a.data(), b.data(), sizeof a) == 0; }

inline void expect_same_bits(const std::vector<Response>& a, const std::vector<Response>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_FALSE(a[i].failure) << "point " << i << ": " << a[i].failure->sentence;
    EXPECT_TRUE(a[i].stress.allFinite()) << "point " << i;
    EXPECT_TRUE(same_bits(a[i].stress, b[i].stress)) << "point " << i << "\n" << a[i].stress - b[i].stress;
    EXPECT_TRUE(same_bits(a[i].stiffness, b[i].stiffness)) << "point " << i;
  }
}

/// Deformation gradients, another one for each point: compression, extension, shear, and a little rotation.
inline std::vector<Tensor2> gradients(std::size_t points, double strain) {
  std::vector<Tensor2> F;
  for (std::size_t i = 0; i < points; ++i) {
    Tensor2 H;
    H << 0.3, 0.5, 0.1, -0.2, -1.0, 0.0, 0.05, 0.2, 0.1;
    F.push_back(Tensor2::Identity() + strain * (1.0 - 0.1 * static_cast<double>(i % 5)) * H);
  }
  return F;
}

/// The straight way from I to F, up to `fraction` of it.
inline std::vector<Tensor2> part(const std::vector<Tensor2>& F, double fraction) {
  std::vector<Tensor2> G;
  for (const Tensor2& f : F) G.push_back(Tensor2::Identity() + fraction * (f - Tensor2::Identity()));
  return G;
}

inline std::vector<Response> trial(MaterialPoints& points, const std::vector<Tensor2>& F) {
  points.begin_step();
  return points.evaluate(F, Operator::elastic);
}

inline void check_repetition(MaterialPoints& points, const Tolerances& tolerances) {
  SCOPED_TRACE("repetition");
  const auto F = gradients(points.size(), tolerances.strain);
  const auto first = trial(points, F);
  expect_same_bits(first, points.evaluate(F, Operator::elastic));
  const auto other = points.evaluate(part(F, 0.7), Operator::none);
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_FALSE(same_bits(other[i].stress, first[i].stress));
  expect_same_bits(first, points.evaluate(F, Operator::elastic));
}

inline void check_rejection(MaterialPoints& points, const Tolerances& tolerances) {
  SCOPED_TRACE("a rejected trial leaves no trace");
  const SavedStates start = points.save();
  const auto F = gradients(points.size(), tolerances.strain);
  trial(points, part(F, 0.5));
  points.commit();
  const auto undisturbed = trial(points, F);
  points.load(start);
  trial(points, part(F, -0.8));
  trial(points, part(F, 0.5));
  points.commit();
  trial(points, part(F, 0.1));
  expect_same_bits(undisturbed, trial(points, F));
}

inline void check_continuation(MaterialPoints& points, const Tolerances& tolerances) {
  SCOPED_TRACE("commit then continue is one longer path");
  const auto F = gradients(points.size(), tolerances.strain);
  const auto at_once = trial(points, F);
  trial(points, part(F, 0.5));
  points.commit();
  const auto in_two = trial(points, F);
  for (std::size_t i = 0; i < points.size(); ++i)
    EXPECT_LE((at_once[i].stress - in_two[i].stress).norm(), tolerances.path * at_once[i].stress.norm());
}

inline void check_reports(MaterialPoints& points, const Tolerances& tolerances) {
  SCOPED_TRACE("reports of what was committed are whole where they are asked for, also after a trial that is rejected");
  const auto F = gradients(points.size(), tolerances.strain);
  auto responses = trial(points, part(F, 0.5));
  const auto of_trial = responses;
  points.commit();
  trial(points, F);
  complete_reports(points, responses);
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t k = 0; k < kReportFields.size(); ++k) {
      const double before = of_trial[i].report.values[k], after = responses[i].report.values[k];
      EXPECT_TRUE(std::isfinite(after)) << kReportFields[k] << " of point " << i;
      EXPECT_TRUE(std::isnan(before) || before == after) << kReportFields[k] << " of point " << i;
    }
    for (const char* judged : {"dem_steps", "seconds", "engine_seconds", "unbalanced_force", "contacts"})
      EXPECT_TRUE(std::isfinite(of_trial[i].report[judged])) << judged << " of point " << i;
  }
}

inline void check_saving(MaterialPoints& points, const Tolerances& tolerances) {
  SCOPED_TRACE("save and load");
  const auto F = gradients(points.size(), tolerances.strain);
  trial(points, part(F, 0.5));
  points.commit();
  const SavedStates states = points.save();
  ASSERT_EQ(states.size(), points.size());
  const auto uninterrupted = trial(points, F);
  points.commit();
  const auto beyond = trial(points, part(F, 1.2));
  points.load(states);
  expect_same_bits(uninterrupted, trial(points, F));
  points.commit();
  expect_same_bits(beyond, trial(points, part(F, 1.2)));
}

inline void check_rotation(MaterialPoints& points, const Tolerances& tolerances) {
  SCOPED_TRACE("rotation in, rotation out");
  const Eigen::Vector3d axis = Eigen::Vector3d(0.2, -0.5, 0.9).normalized();
  const auto F = gradients(points.size(), tolerances.strain);
  const auto unrotated = trial(points, F);
  for (const double angle : {0.3, std::numbers::pi / 2}) {
    const Tensor2 Q = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    std::vector<Tensor2> QF;
    for (const Tensor2& f : F) QF.push_back(Q * f);
    const auto rotated = trial(points, QF);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Tensor2 expected = rotate(unrotated[i].stress, Q);
      const Tensor4 stiffness = rotate(unrotated[i].stiffness, Q);
      EXPECT_LE((rotated[i].stress - expected).norm(), tolerances.rotation * expected.norm()) << angle;
      EXPECT_LE((rotated[i].stiffness - stiffness).norm(), tolerances.rotation * stiffness.norm()) << angle;
    }
  }
}

inline void check_bad_gradients(MaterialPoints& points, const Tolerances& tolerances) {
  SCOPED_TRACE("bad F is a failure value");
  const auto F = gradients(points.size(), tolerances.strain);
  const auto good = trial(points, F);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), -1.0, 0.0}) {
    for (std::size_t k = 0; k < points.size(); k += 2) {
      auto G = F;
      G[k] = Tensor2::Identity();
      G[k](1, 1) = bad;
      const auto answer = points.evaluate(G, Operator::elastic);
      for (std::size_t i = 0; i < points.size(); ++i) {
        EXPECT_EQ(answer[i].failure.has_value(), i == k) << bad << " at " << i;
        if (i != k) {
          EXPECT_TRUE(same_bits(answer[i].stress, good[i].stress)) << i;
        }
      }
      if (!answer[k].failure) continue;
      EXPECT_EQ(answer[k].failure->point, k);
      EXPECT_FALSE(answer[k].failure->sentence.empty());
      EXPECT_FALSE(answer[k].stress.allFinite()) << "a failed point must not look like an answer";
    }
  }
}

/// A copy, made after the point has gone a way on which its time scale may have changed, answers as its original: the
/// same stress to the bit, in as many DEM steps.
inline void check_copies(LocalPoints& points, const Tolerances& tolerances) {
  SCOPED_TRACE("a copy answers as its original");
  const std::size_t count = points.size();
  const auto F = gradients(count, 4 * tolerances.strain);
  trial(points, part(F, 0.5));
  points.commit();
  for (std::size_t k = 0; k < count; ++k) points.copy(k);
  ASSERT_EQ(points.size(), 2 * count);
  auto twice = F;
  twice.insert(twice.end(), F.begin(), F.end());
  const auto answers = trial(points, twice);
  const std::vector<Response> originals(answers.begin(), answers.begin() + static_cast<std::ptrdiff_t>(count));
  const std::vector<Response> copies(answers.begin() + static_cast<std::ptrdiff_t>(count), answers.end());
  expect_same_bits(originals, copies);
  for (std::size_t k = 0; k < count; ++k)
    EXPECT_EQ(originals[k].report["dem_steps"], copies[k].report["dem_steps"]) << "point " << k;
  for (std::size_t k = 0; k < count; ++k) points.remove(0);
  ASSERT_EQ(points.size(), count);
  expect_same_bits(trial(points, F), copies);
}

/// All of it, each part from the state in which the points come. At least three points.
inline void check(MaterialPoints& points, const Tolerances& tolerances) {
  ASSERT_GE(points.size(), 3U);
  const SavedStates start = points.save();
  for (const auto& part_of_contract : {check_repetition, check_rejection, check_continuation, check_reports,
                                       check_saving, check_rotation, check_bad_gradients}) {
    points.load(start);
    part_of_contract(points, tolerances);
  }
  points.load(start);
}

/// The same for the points of one rank.
inline void check_local(LocalPoints& points, const Tolerances& tolerances) {
  check(points, tolerances);
  const SavedStates start = points.save();
  check_copies(points, tolerances);
  points.load(start);
}

}  // namespace femxdem::contract
