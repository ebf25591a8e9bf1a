#pragma once

#include "double_stress.hpp"
#include "formulation.hpp"

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
class SecondGradientQ8 : public Formulation {
 public:
  /// law: double-stress law [N].
  SecondGradientQ8(const Mesh& mesh, const DoubleStiffness& law);

  GradientMatrix B(std::size_t point) const override { return in_plane(point); }
  double thickness(const Point2&) const override { return 1; }
  Eigen::VectorXd force(int e, const Configuration& at, std::span<const Tensor2> stress) const override;
  Eigen::MatrixXd matrix(int e, const Linearisation& at) const override;
  void commit(Eigen::VectorXd& x) override;
  void save(NamedArrays& arrays) const override;
  void load(const NamedArrays& arrays) override;
  /// `micro_gradient`, 11, 12, 21, 22; 0 at mid-side nodes.
  std::vector<Field> node_fields() const override;
  /// `double_stress` [N], order of DoubleStress.
  std::vector<Field> point_fields() const override;

  /// Committed double stress of a point [N], order of DoubleStress.
  const DoubleStress& double_stress(std::size_t point) const { return sigma_[point]; }
  /// Accumulated micro gradient at a corner node, order 11, 12, 21, 22; zero at mid-side nodes.
  Eigen::Vector4d micro_gradient(int node) const;

 private:
  DoublePiola double_piola(std::size_t point, const Eigen::VectorXd& x, const Tensor2& F, bool derivatives) const;
  void update_constraints();

  DoubleStiffness law_;
  std::vector<Eigen::Matrix2d> F_n_;  // committed in-plane deformation gradient of the points
  std::vector<DoubleStress> sigma_;   // committed double stress of the points
  Eigen::VectorXd micro_gradient_;    // accumulated v, 4 per corner
};

}  // namespace femxdem
