#include "straining.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <unsupported/Eigen/MatrixFunctions>

#include "errors.hpp"

namespace femxdem {
namespace {

using RowMajor2 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// exp(A) - I by its series, without the cancellation that exp(A) - I suffers for small A; |A| of order 1 at most.
Tensor2 expm1(const Tensor2& A) {
  Tensor2 sum = A, term = A;
  for (int k = 2; term.norm() > 1e-18 * sum.norm() && k < 60; ++k) {
    term = term * A / k;
    sum += term;
  }
  return sum;
}

std::string unstrained(const Tensor2& F) {
  return fmt::format(
      "deformation gradient [{:.4g} {:.4g} {:.4g}; {:.4g} {:.4g} {:.4g}; {:.4g} {:.4g} {:.4g}] is not "
      "admissible (det F = {:.4g})",
      F(0, 0), F(0, 1), F(0, 2), F(1, 0), F(1, 1), F(1, 2), F(2, 0), F(2, 1), F(2, 2), F.determinant());
}

/// Of a tensor whose eigenvalues are real and positive; Eigen's is compiled here alone.
Tensor2 logarithm(const Tensor2& A) { return A.log(); }

}  // namespace

NetworkLevel network_level(const Tensor2& stretch, const Tensor2& stress) {
  const double strain = 0.5 * logarithm(stretch.transpose() * stretch).norm();
  const double pressure = -stress.trace() / 3;
  const double level = pressure > 0 ? std::floor(std::log2(pressure)) : -1e3;
  return {static_cast<int>(strain / 0.02), static_cast<int>(level)};
}

Straining plan_straining(const VolumeElementOptions& options, StrainedPoint& point, double time_step, std::size_t index,
                         const Tensor2& F) {
  Straining plan;
  if (!F.allFinite() || F.determinant() <= 0) {
    plan.refusal = Failure{index, unstrained(F), kSmallerStep};
    return plan;
  }
  const PolarDecomposition polar = polar_decomposition(F);
  plan.R = polar.R;
  plan.U = options.quantised ? quantised(polar.U) : polar.U;
  // ln of U U_n^-1, which is similar to a symmetric positive definite tensor: its eigenvalues are real and positive
  const Tensor2 increment = logarithm(plan.U * point.stretch.inverse());
  const double size = increment.norm();
  if (!(size <= options.max_increment)) {
    plan.refusal =
        Failure{index, fmt::format("strain increment {:.3g} in one trial, limit {:.3g}", size, options.max_increment),
                kSmallerStep};
    return plan;
  }
  if (size < 1e-14) return plan;
  const double rate = options.inertial_number / point.reference_time_scale;
  const long needed = std::max<long>(options.min_steps, std::lround(std::ceil(size / (rate * time_step))));
  long& steps = point.frozen_steps;
  if (!options.freeze_steps || steps == 0 || needed > 2 * steps) steps = needed;
  plan.steps = steps;
  const RowMajor2 L = expm1(increment / static_cast<double>(steps)) / time_step;
  std::copy_n(L.data(), 9, plan.velocity_gradient.begin());
  return plan;
}

void judge(const VolumeElementOptions& options, const Straining& straining, std::size_t index, const Strained& found,
           Response& response) {
  const auto fail = [&](std::string sentence, std::string advice) {
    response.failure = Failure{index, std::move(sentence), std::move(advice)};
  };
  const double miss = (found.stretch - straining.U).norm() / straining.U.norm();
  if (!(miss <= 1e-9))
    return fail(fmt::format("its cell missed the stretch by {:.2e} (relative), limit 1e-09", miss), kSmallerStep);
  if (response.report["contacts"] == 0)
    return fail("it has lost all its contacts: no stress, no unbalanced force",
                "It can carry no tension: keep it under pressure, give it ve.cohesion, or try a smaller load step.");
  const double unbalanced = response.report["unbalanced_force"];
  if (!(unbalanced <= options.max_unbalanced_force) && straining.steps == 0)
    return fail(fmt::format("unbalanced force {:.1e} without any strain, limit {:.1e}", unbalanced,
                            options.max_unbalanced_force),
                "The state that it starts from is not at rest: let the scene come to rest before it is adopted.");
  if (!(unbalanced <= options.max_unbalanced_force))
    return fail(fmt::format("unbalanced force {:.1e} after {} steps, limit {:.1e}", unbalanced, straining.steps,
                            options.max_unbalanced_force),
                fmt::format("Lower ve.inertial_number (now {:g}) or ve.time_step_safety.", options.inertial_number));
  if (!found.stress.allFinite()) return fail("its stress is not a number", kSmallerStep);
  response.stress = rotate(found.stress, straining.R);
  if (found.stiffness) response.stiffness = rotate(*found.stiffness, straining.R);
}

void require_time_scale(double time_scale, double time_step, double mean_stress) {
  if (time_scale > 0 && std::isfinite(time_scale) && time_step > 0) return;
  throw UserError(
      fmt::format("volume element: mean stress {:.3g} Pa, time step {:.3g} s: without pressure the inertial number "
                  "sets no rate; start from a state under compression",
                  mean_stress, time_step));
}

void require_answerable(Operator wanted, std::size_t gradients, std::size_t points) {
  if (wanted == Operator::tangent)
    throw UserError("volume elements have no tangent in closed form; choose the elastic or the quasi-Newton operator");
  if (gradients != points) throw std::invalid_argument("evaluate: one deformation gradient per volume element");
}

void require_committable(bool trial_pending, bool trial_failed) {
  if (!trial_pending) throw std::logic_error("commit: there is no trial");
  if (trial_failed) throw std::logic_error("commit: a volume element failed in this trial");
}

}  // namespace femxdem
