#pragma once

#include <array>
#include <memory>

#include "double_stress.hpp"
#include "element.hpp"

namespace femxdem {

/// Local second-gradient continuum in plane strain: 8 nodes for u, 4 for the micro gradient v_ij, one multiplier
/// lambda_ij per element (Chambon, Caillerie, El Hassan 1998; Matsushima, Chambon, Caillerie 2002).
///
///   int sigma:grad u* + Sigma:.grad v* - int_n lambda:(grad_n u* - v*) = P*_ext,   int_n lambda*:(grad_n Du - v) = 0
///
/// v is the increment of the micro gradient over the step, counted from 0 at its start. The terms with lambda are
/// written on the configuration Omega_n at the start of the step: they are linear within it, and the error is of the
/// order of the step's strain in the second-gradient part only. Constraint by augmented Lagrangian on the element mean
/// of the gap g = v - grad_n Du: lambda <- lambda + r g rides on the iterations of the solver, so that the matrix has
/// no multiplier unknowns and stays positive definite where the law is.
///
/// Unknowns: displacements as in Element, then v at the corner nodes, 4 per corner, order 11, 12, 21, 22.
class SecondGradientQ8 : public Element {
 public:
  /// law: double-stress law [N]; penalty: r of the augmented Lagrangian [Pa].
  SecondGradientQ8(const Mesh& mesh, const DoubleStiffness& law, double penalty);

  int unknowns() const override { return unknowns_; }
  std::vector<int> dofs(int e) const override;
  double residual_length(int i) const override;
  int gradient_dof(int node, int c) const override;
  Eigen::VectorXd force(int e, const Eigen::VectorXd& x, std::span<const Tensor2> F,
                        std::span<const Tensor2> stress) const override;
  Eigen::VectorXd constraint_force(int e, const Eigen::VectorXd& x) const override;
  Eigen::MatrixXd matrix(int e, const Eigen::VectorXd& x, std::span<const Tensor2> F, std::span<const Tensor4> dPdF,
                         bool exact) const override;
  void begin_step(Eigen::VectorXd& x) override;
  Eigen::VectorXd multipliers() const override;
  void set_multipliers(const Eigen::VectorXd& values) override;
  void update_multipliers(const Eigen::VectorXd& x) override;
  void extrapolate(Eigen::VectorXd& x, double factor) override;
  void commit(const Eigen::VectorXd& x) override;
  double constraint_gap(const Eigen::VectorXd& x) const override;
  void save(NamedArrays& arrays) const override;
  void load(const NamedArrays& arrays) override;

  /// Penalty r of the augmented Lagrangian [Pa].
  void set_penalty(double penalty) { penalty_ = penalty; }
  /// Committed double stress of a point [N], order of DoubleStress.
  const DoubleStress& double_stress(std::size_t point) const { return sigma_[point]; }
  /// Multiplier of element e [Pa], order 11, 12, 21, 22.
  Eigen::Vector4d multiplier(int e) const { return lambda_[e]; }
  /// Accumulated micro gradient at a corner node, order 11, 12, 21, 22; zero at mid-side nodes.
  Eigen::Vector4d micro_gradient(int node) const;

 private:
  using Gap = Eigen::Matrix<double, 4, 32>;
  using Vector32 = Eigen::Matrix<double, 32, 1>;
  Vector32 local_increment(int e, const Eigen::VectorXd& x) const;  // of u over the step, and v
  Eigen::Vector4d gap(int e, const Eigen::VectorXd& x) const { return gap_[e] * local_increment(e, x); }
  DoubleStress gradient_of_v(int e, int q, const Eigen::VectorXd& x) const;  // dv_ij / dX_K
  void update_gap_operators();

  DoubleStiffness law_;
  double penalty_;
  int unknowns_;
  std::vector<int> corner_;  // number of a node among the corner nodes, -1 at mid-side nodes
  double mean_size_ = 0;
  std::vector<Eigen::Matrix2d> F_n_;  // committed in-plane deformation gradient of the points
  std::vector<DoubleStress> sigma_;   // committed double stress of the points
  std::vector<Eigen::Vector4d> lambda_n_, lambda_, lambda_increment_;
  std::vector<Gap> gap_;            // mean of v - grad_n Du over Omega_n from the local increments
  std::vector<double> volume_n_;    // of the elements at the start of the step [m^2]
  Eigen::VectorXd micro_gradient_;  // accumulated v, 4 per corner
};

/// The formulation of an [element] table on its mesh, which is kept by reference.
std::unique_ptr<Element> make_element(const ElementParameters& e, const Mesh& mesh);

}  // namespace femxdem
