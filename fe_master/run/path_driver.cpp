#include "path_driver.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cassert>
#include <chrono>
#include <cmath>
#include <random>

#include "errors.hpp"
#include "point_fields.hpp"
#include "seconds_since.hpp"

namespace femxdem {
namespace {

constexpr double kDivergence = 1e3;   // residual over the step's smallest
constexpr double kDifference = 1e-6;  // of a strain, for dF/dE
const StrainComponents kAllComponents = {0, 1, 2, 3, 4, 5};

/// exp of a symmetric tensor.
Tensor2 exponential(const Tensor2& E) {
  const Eigen::SelfAdjointEigenSolver<Tensor2> eigen(E);
  const Eigen::Vector3d stretches = eigen.eigenvalues().array().exp();
  return eigen.eigenvectors() * stretches.asDiagonal() * eigen.eigenvectors().transpose();
}

/// Mean stress of the isotropic state of the same norm, the larger of two states; 1 where both are free of stress.
double stress_scale(const Tensor2& one, const Tensor2& other) {
  const double scale = std::max(one.norm(), other.norm()) / std::sqrt(3.0);
  return scale > 0 ? scale : 1;
}

Tensor2 product(const Tensor4& A, const Tensor2& dF) {
  Tensor2 dP = Tensor2::Zero();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) dP(i, j) += A.block<1, 3>(pair(i, j), pair(k, 0)).dot(dF.row(k));
    }
  }
  return dP;
}

}  // namespace

PathVector path_components(const Tensor2& T) {
  PathVector v;
  for (int c = 0; c < 6; ++c)
    v[c] = 0.5 * (T(kPathPairs[c][0], kPathPairs[c][1]) + T(kPathPairs[c][1], kPathPairs[c][0]));
  return v;
}

Tensor2 from_path_components(const PathVector& v) {
  Tensor2 T;
  for (int c = 0; c < 6; ++c) T(kPathPairs[c][0], kPathPairs[c][1]) = T(kPathPairs[c][1], kPathPairs[c][0]) = v[c];
  return T;
}

PathVector path_strain(const Tensor2& F) { return path_components(logarithmic_strain(F.transpose())); }

PathDriver::PathDriver(MaterialPoints& point, const SolverParameters& parameters)
    : point_(point, parameters.answer_at), parameters_(parameters) {
  assert(point.size() == 1 && is_given(parameters.tolerance) && is_given(parameters.displacement_tolerance));
  begin_segment({});
  point_.commit();
  complete_reports(point_, {&response_, 1});
}

void PathDriver::begin_segment(const PathSegment& segment) {
  F_ = F_end_;
  point_.start_from(std::array{F_});
  point_.begin_step();
  response_ = point_.evaluate(std::array{F_}, Operator::elastic).front();
  if (response_.failure) throw UserError(describe(*response_.failure));
  R_ = polar_decomposition(F_).R;
  tangent_.emplace(
      rotate(response_.stiffness, R_.transpose()), kAllComponents,
      LearningLimits{parameters_.qn_min, parameters_.qn_max, parameters_.qn_skew, 1, 0, parameters_.qn_noise});
  segment_ = segment;
  F_start_ = F_;
  E_start_ = path_strain(F_);
  stress_start_ = path_components(response_.stress);
  fraction_ = last_fraction_ = end_ = 0;
  lacking_ = PathVector::Zero();
}

bool PathDriver::stress_controlled(int component) const { return is_given(segment_.stress[component]); }

std::vector<int> PathDriver::free_components() const {
  std::vector<int> free;
  for (int c = 0; c < 6; ++c) {
    if (stress_controlled(c)) free.push_back(c);
  }
  return free;
}

Tensor2 PathDriver::deformation(const PathVector& E) const { return exponential(from_path_components(E)) * R_; }

Tensor2 PathDriver::prescribed_deformation(double fraction) const {
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Tensor2 end = Eigen::Map<const RowMajor>(segment_.deformation_gradient.data());
  return F_start_ + fraction * (end - F_start_);
}

PathVector PathDriver::strain_target(double fraction) const {
  PathVector E = E_start_;
  for (int c = 0; c < 6; ++c) {
    if (is_given(segment_.strain[c])) E[c] += fraction * (segment_.strain[c] - E_start_[c]);
  }
  return E;
}

PathVector PathDriver::stress_target(double fraction) const {
  PathVector s = stress_start_;
  for (const int c : free_components()) s[c] += fraction * (segment_.stress[c] - stress_start_[c]);
  return s;
}

/// Start of the iterations: the last increment extrapolated, corrected for the carried residual, the change of the
/// stress targets, the prescribed strains, and what the step's start lacks, with which its stresses begin.
PathVector PathDriver::predict(double fraction, double end) const {
  const double factor = last_fraction_ > 0 ? (fraction - fraction_) / last_fraction_ : 0;
  const PathVector E = path_strain(F_);
  PathVector guess = E + factor * last_E_change_;
  PathVector given = point_.within<PathVector>(path_strain(F_end_), strain_target(end)) - guess;
  for (const int c : free_components()) given[c] = 0;
  const PathVector extrapolated = factor * (stress_target(fraction_) - stress_target(fraction_ - last_fraction_));
  const PathVector missing = stress_target(fraction) + (1 - point_.theta()) * lacking_ - extrapolated -
                             path_components(response_.stress) - lacking_;
  return guess + correction(E, response_.stress, missing, given);
}

Eigen::Matrix<double, 6, 6> PathDriver::stress_by_strain(const PathVector& E, const Tensor2& stress) const {
  const Tensor2 F = deformation(E);
  const Tensor2 F_inverse = F.inverse();
  const Tensor4 A = tangent_->piola(F, stress);
  Eigen::Matrix<double, 6, 6> K;
  for (int c = 0; c < 6; ++c) {
    PathVector e = PathVector::Zero();
    e[c] = kDifference;
    const Tensor2 dF = (deformation(E + e) - deformation(E - e)) / (2 * kDifference);
    const Tensor2 h = dF * F_inverse;
    // sigma = P F^T / J: dsigma = dP F^T / J + sigma h^T - tr(h) sigma.
    const Tensor2 ds = product(A, dF) * F.transpose() / F.determinant() + stress * h.transpose() - h.trace() * stress;
    K.col(c) = path_components(ds);
  }
  return K;
}

PathVector PathDriver::correction(const PathVector& E, const Tensor2& stress, const PathVector& missing,
                                  const PathVector& given) const {
  const std::vector<int> free = free_components();
  PathVector change = given;
  if (free.empty()) return change;
  const Eigen::Matrix<double, 6, 6> K = stress_by_strain(E, stress);
  const Eigen::VectorXd rhs = (missing - K * given)(free);
  const Eigen::MatrixXd K_free = K(free, free);
  const Eigen::VectorXd dE = K_free.fullPivLu().solve(rhs);
  for (std::size_t i = 0; i < free.size(); ++i) change[free[i]] = dE[static_cast<Eigen::Index>(i)];
  return change;
}

PathStep PathDriver::solve(double end) {
  PathStep step;
  const double fraction = point_.within(end_, end);
  const std::vector<int> free = free_components();
  const bool by_gradient = !segment_.deformation_gradient.empty();
  const PathVector committed = path_strain(F_);
  const PathVector target = stress_target(fraction) + (1 - point_.theta()) * lacking_;
  point_.start_from(std::array{F_end_});
  point_.begin_step();
  tangent_->begin_step(F_, response_.stress);
  trial_fraction_ = fraction;
  trial_end_ = end;
  PathVector E = by_gradient ? committed : predict(fraction, end);
  double least = std::numeric_limits<double>::infinity();
  while (static_cast<int>(step.table.size()) < parameters_.max_iterations) {
    PathIteration& now = step.table.emplace_back();
    const Tensor2 F = by_gradient ? point_.within(F_end_, prescribed_deformation(end)) : deformation(E);
    if (!evaluate(F, step)) return step;
    const PathVector missing = target - path_components(trial_.stress);
    const double scale = stress_scale(trial_.stress, from_path_components(stress_start_));
    for (const int c : free) now.residual = std::max(now.residual, std::abs(missing[c]) / scale);
    if (!std::isfinite(now.residual) || now.residual > kDivergence * least) {
      step.reason = fmt::format("diverged: residual {:.1e} after {:.1e}", now.residual, least);
      return step;
    }
    least = std::min(least, now.residual);
    const PathVector dE = correction(E, trial_.stress, missing, PathVector::Zero());
    const double moved = (E - committed).norm();
    now.correction = moved > 0 ? dE.norm() / moved : 0;
    step.converged = now.residual <= parameters_.tolerance && now.correction <= parameters_.displacement_tolerance;
    if (step.converged) return step;
    E += dE;
  }
  step.reason = fmt::format("not converged in {} iterations: least residual {:.1e}, tolerance {:.1e}",
                            step.table.size(), least, parameters_.tolerance);
  return step;
}

bool PathDriver::evaluate(const Tensor2& F, PathStep& step) {
  const auto start = std::chrono::steady_clock::now();
  trial_F_ = F;
  trial_ = point_.evaluate(std::array{F}, Operator::none).front();
  PathIteration& now = step.table.back();
  now.seconds = seconds_since(start);
  if (trial_.failure) {
    step.failure = trial_.failure;
    step.reason = trial_.failure->sentence;
    return false;
  }
  now.engine_seconds = trial_.report["engine_seconds"];
  now.dem_steps = trial_.report["dem_steps"];
  tangent_->learn(F, trial_.stress);
  return true;
}

double PathDriver::noise(double amplitude, int samples) {
  assert(samples > 2);
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  PathVector direction;
  for (double& value : direction) value = normal(random);
  const Tensor2 D = from_path_components(direction).normalized();
  Eigen::MatrixXd line(samples, 2), stresses(samples, 9);
  for (int k = 0; k < samples; ++k) {
    const double s = amplitude * (2.0 * k / (samples - 1) - 1);
    const Response r = point_.evaluate(std::array{Tensor2(exponential(s * D) * trial_F_)}, Operator::none).front();
    if (r.failure) return std::numeric_limits<double>::quiet_NaN();
    line.row(k) << 1, s / amplitude;
    stresses.row(k) = r.stress.reshaped().transpose();
  }
  trial_ = point_.evaluate(std::array{trial_F_}, Operator::none).front();
  const Eigen::MatrixXd rest = stresses - line * line.colPivHouseholderQr().solve(stresses).eval();
  return rest.norm() / std::sqrt(samples - 2.0) / trial_.stress.norm();
}

void PathDriver::commit() {
  point_.commit();
  complete_reports(point_, {&trial_, 1});
  last_E_change_ = path_strain(trial_F_) - path_strain(F_);
  last_fraction_ = trial_fraction_ - fraction_;
  fraction_ = trial_fraction_;
  end_ = trial_end_;
  F_end_ = point_.end(F_end_, trial_F_);
  if (point_.theta() < 1) {
    const Tensor2 stress = MidStepPoints::end_stresses(std::array{F_end_}, std::array{trial_}).front();
    lacking_ = path_components(stress) - stress_target(end_);
  }
  F_ = trial_F_;
  response_ = trial_;
}

/// visit(numbers, how many) for all of the committed state.
template <class Driver, class Visit>
void PathDriver::visit_state(Driver& driver, Visit visit) {
  for (auto* number : {&driver.fraction_, &driver.end_, &driver.last_fraction_}) visit(number, 1);
  for (auto* T : {&driver.R_, &driver.F_start_, &driver.F_, &driver.F_end_, &driver.response_.stress})
    visit(T->data(), 9);
  for (auto* v : {&driver.E_start_, &driver.stress_start_, &driver.last_E_change_, &driver.lacking_})
    visit(v->data(), 6);
  visit(driver.response_.stiffness.data(), 81);
  visit(driver.response_.report.values.data(), driver.response_.report.values.size());
}

void PathDriver::save(NamedArrays& arrays) const {
  std::vector<double> values;
  visit_state(*this,
              [&](const double* numbers, std::size_t count) { values.insert(values.end(), numbers, numbers + count); });
  tangent_->save(values);
  arrays.emplace_back("path.state", std::move(values));
}

void PathDriver::load(const NamedArrays& arrays, const PathSegment& segment) {
  const std::vector<double>& values = find_array(arrays, "path.state");
  std::size_t position = 0;
  visit_state(*this, [&](double* numbers, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) numbers[i] = values.at(position++);
  });
  tangent_->load(values, position);
  segment_ = segment;
}

}  // namespace femxdem
