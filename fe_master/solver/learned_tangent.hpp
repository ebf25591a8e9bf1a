#pragma once

#include <vector>

#include "strain_components.hpp"
#include "tensor.hpp"

namespace femxdem {

/// dP/dF (row 3 i + J, column 3 k + L) from c = d sigma / d(spatial gradient): exact, unsymmetric in general [Pa].
Tensor4 piola_tangent(const Tensor4& c, const Tensor2& stress, const Tensor2& F);

/// dP/dF of the elastic operator alone, J C : (dF F^-1) F^-T, without the terms of the current stress: symmetric [Pa].
Tensor4 piola_elastic(const Tensor4& C, const Tensor2& F);

/// dP/dF of a law sigma = R s(U) R^T, F = R U, with ds = C : sym(dU U_n^-1): exact, unsymmetric in general [Pa].
/// U_n: right stretch at the start of the step, from which C counts strain.
Tensor4 piola_corotational(const Tensor4& C, const Tensor2& stress, const Tensor2& F, const Tensor2& U_n);

using MandelMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 6, 6>;
using MandelVector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 6, 1>;

/// Symmetric tensor in Mandel form (shear times sqrt(2)), chosen components.
MandelVector to_mandel(const Tensor2& T, const StrainComponents& components);
MandelMatrix to_mandel(const Tensor4& C, const StrainComponents& components);
/// Back; the components not chosen are 0.
Tensor4 from_mandel(const MandelMatrix& C, const StrainComponents& components);

/// Bounds and thresholds of a learned tangent.
struct LearningLimits {
  double min = 0.02;   ///< least eigenvalue of its symmetric part in the elastic metric [-]
  double max = 1.2;    ///< largest one [-]
  double skew = 0.6;   ///< largest norm of its skew part [-]
  double first = 1;    ///< weight of the first pair of a step: from the committed state to the first trial [-]
  double scatter = 0;  ///< of a pair's stress about what its strain explains, over it; 0: every pair is met exactly [-]
  double noise = 1e-6;  ///< change of strain below which nothing is learned [-]
};

/// How far a learned tangent was off before it learned: squares of the misfit y - C s and of the expected C s [Pa^2].
struct Misfit {
  double missed = 0, expected = 0;
};

/// Finite-difference probes of one point: changes of strain and of stress, one column a component.
struct StrainProbe {
  double size = 0;
  MandelVector strain, stress;  ///< of the trial that is probed, in the frame of the stretch
  MandelMatrix strains, stresses;
};

/// Tangent of one material point, learned from the responses that it has given: elastic at first, then a rank-one
/// update from each pair of successive trials, C <- C + (y - C s) g^T, kept between steps. It lives in the frame of the
/// stretch, s = sym(U U_n^-1) and y = R^T sigma R, so that objectivity is exact; bounded in the elastic metric.
///
/// A law in closed form meets every pair: g = s / (s^T s) (Broyden 1965; partitioned as in Griewank and Toint 1982, a
/// Gauss point being a partition). A volume element is a rough function of its strain, and neighbouring pairs of a step
/// are nearly parallel: there g = P s / (s^T P s + R) (Kalman 1960, each row of C a state that wanders), in the elastic
/// metric. P is how little is known of C in each direction: it falls by g s^T P at a pair and returns towards 1 from
/// step to step. R is the pair's own scatter: `scatter` of |s|, and a small part of the step's first change, so that a
/// pair far smaller than that says little. The first pair of a step has R = (1 / first - 1) |s|^2: what a trial's end
/// moves by when its strain moves is not what a whole increment does to a volume element, whose stress follows the rate
/// of strain.
class LearnedTangent {
 public:
  LearnedTangent(const Tensor4& elastic, const StrainComponents& components, const LearningLimits& limits);

  /// Start of a step from the committed F and stress.
  void begin_step(const Tensor2& F, const Tensor2& stress);
  /// Response of a trial of this step. Its misfit; 0 of a step's first trial and where nothing is learned.
  Misfit learn(const Tensor2& F, const Tensor2& stress);
  /// Stress at F, by the tangent, where it was `stress` at `from` [Pa].
  Tensor2 predict(const Tensor2& F, const Tensor2& from, const Tensor2& stress) const;
  /// Probes about a trial: start, one F for each component, its answer, and the tangent from all answers (no bounds).
  StrainProbe start_probe(const Tensor2& F, const Tensor2& stress, double size) const;
  Tensor2 probe(const StrainProbe& probe, const Tensor2& F, int component) const;
  void record(StrainProbe& probe, const Tensor2& probed_F, const Tensor2& stress, int component) const;
  void finish_probe(const StrainProbe& probe);
  /// dP/dF at a trial [Pa].
  Tensor4 piola(const Tensor2& F, const Tensor2& stress) const;
  /// Smallest eigenvalue of the symmetric part over that of elasticity [-]: below 0 the point softens.
  double least_eigenvalue() const;

  void save(std::vector<double>& values) const;
  /// Takes its values from `values` at `position`, which advances.
  void load(const std::vector<double>& values, std::size_t& position);

 private:
  MandelVector strain(const Tensor2& U) const;  // sym(U U_n^-1) - I
  MandelVector unrotated(const Tensor2& stress, const Tensor2& R) const;
  MandelVector gain(const MandelVector& strain_change);  // g of the pair
  void bound();

  StrainComponents components_;
  LearningLimits limits_;
  MandelMatrix cholesky_;  // L of the elastic stiffness C0 = L L^T
  MandelMatrix C_;
  MandelMatrix unknown_;     // P: variance of C along each direction of strain, elastic metric [-]
  double first_change_ = 0;  // |s|^2 of the step's first pair, elastic metric [Pa]
  Tensor2 U_n_ = Tensor2::Identity();
  MandelVector strain_, stress_;  // of the last trial, in the frame of the stretch
  bool first_ = true;             // the next pair starts from the committed state
};

}  // namespace femxdem
