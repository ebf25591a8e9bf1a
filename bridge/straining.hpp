#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "equal_histories.hpp"
#include "material_points.hpp"
#include "ve_parameters.hpp"

namespace femxdem {

/// How the volume elements of a rank are strained and judged.
struct VolumeElementOptions {
  double inertial_number = 5e-3;      ///< I = rate a sqrt(rho / p) of a trial [-]
  int min_steps = 10;                 ///< least DEM steps of a trial that strains
  bool freeze_steps = true;           ///< a load step's trials take as many DEM steps as its first
  double max_unbalanced_force = 0.2;  ///< an answer above is refused [-]
  double max_increment = 0.2;         ///< largest |ln U_inc| of one trial [-]
  /// Where in the trial its stress belongs: 1, at its end; 1/2 to 2/3: it is the mean over the trial, which belongs
  /// there (later ones weigh more beyond 1/2: 1 + late (2 t / T - 1)) [-].
  double answer_at = 1;
  VeStiffness stiffness = VeStiffness::affine;
  bool quantised = false;      ///< stretches are followed up to kQuantum (compact cells; YADE to compare bits)
  bool serialise = false;      ///< YADE's volume elements are saved and restored at every trial, not forked
  bool start_at_rest = false;  ///< a trial forgets the velocities of its start (compact cells)
  int hold_steps = 0;          ///< DEM steps at the end of a trial that strains, without deformation (compact cells)
  /// Where remarks go: a trial that was repeated, a fork that was refused.
  std::function<void(std::string_view)> say = [](std::string_view) {};
};

/// DEM steps between the stresses of a mean over `steps`: one stress takes 0.4 of a step. It is off by 1e-5 to 3e-5 of
/// the mean of all of them, a fifth of what small changes of a trial move it by (validation/quasi_static).
inline long sample_every(long steps) { return std::clamp(steps / 25, 1L, 4L); }

/// Whether a trial answers with a mean, and how late its stresses weigh then.
inline bool answers_mean(const VolumeElementOptions& options) { return options.answer_at < 1; }
/// So that the mean of what is linear in time, by the trapezoidal rule over the stresses taken, is its value at
/// answer_at.
inline double lateness(const VolumeElementOptions& options, long steps) {
  if (steps == 0) return 0;
  const long every = sample_every(steps), last = steps % every;
  const double cubes = static_cast<double>(steps / every * every * every * every + last * last * last);
  return (6 * options.answer_at - 3) / (1 + 2 * cubes / std::pow(static_cast<double>(steps), 3));
}

/// In which class of strain and of pressure a cell is; where it leaves it, its contact network may be another.
using NetworkLevel = std::array<int, 2>;
NetworkLevel network_level(const Tensor2& stretch, const Tensor2& stress);

/// What the straining of one volume element needs to know of it, whichever engine holds it.
struct StrainedPoint {
  Tensor2 stretch = Tensor2::Identity();  ///< committed deformation gradient of the cell
  NetworkLevel level{};                   ///< committed
  double reference_time_scale = 0;        ///< a sqrt(rho / p) of the state that the case starts from [s]
  std::uint64_t origin = 0;               ///< which state that is: its hash
  long frozen_steps = 0;                  ///< of this load step's trials; 0: to be chosen at the next one
};

/// What a volume element is asked to do: hold velocity_gradient for `steps` DEM steps.
struct Straining {
  Tensor2 R = Tensor2::Identity();
  Tensor2 U = Tensor2::Identity();
  std::array<double, 9> velocity_gradient{};  ///< row-major [1/s]
  long steps = 0;
  std::optional<Failure> refusal;
};

/// The straining that takes volume element `index` from its committed stretch to F = R U along the stretch only:
/// L = (U_inc^(1/n) - I) / dt, U_inc = U U_n^-1. The number of steps n = max(min_steps, |ln U_inc| / (rate dt)), rate =
/// I / reference time scale, is frozen from the first trial of a load step on (unless a later one would need more than
/// twice as many), so that the response is a smooth function of F. time_step: of the DEM [s].
Straining plan_straining(const VolumeElementOptions& options, StrainedPoint& point, double time_step, std::size_t index,
                         const Tensor2& F);

/// What an engine has found at the end of a straining, in the frame of the stretch.
struct Strained {
  Tensor2 stress;                    ///< its answer: Cauchy, symmetric, of the end or the mean [Pa]
  Tensor2 stretch;                   ///< deformation gradient of the cell
  std::optional<Tensor4> stiffness;  ///< [Pa], when asked for
};

/// Fills stress and stiffness of a response (its report is there already) or its failure: a cell that missed its
/// stretch, has lost its contacts, is out of balance or whose stress is no number is not an answer.
void judge(const VolumeElementOptions& options, const Straining& straining, std::size_t index, const Strained& found,
           Response& response);

/// A tensor of numbers that lie row by row.
inline Tensor2 tensor(const std::array<double, 9>& numbers) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.data());
}

/// Throws UserError for a state without pressure: the inertial number sets no rate without a time scale.
void require_time_scale(double time_scale, double time_step, double mean_stress);
/// Throws UserError for a stiffness that no volume element has, std::invalid_argument for another number of points.
void require_answerable(Operator wanted, std::size_t gradients, std::size_t points);
/// Throws std::logic_error where there is no trial, or one that failed.
void require_committable(bool trial_pending, bool trial_failed);

inline constexpr const char* kSmallerStep = "Try a smaller load step.";

}  // namespace femxdem
