#pragma once

#include <Eigen/Dense>
#include <span>
#include <vector>

#include "mesh.hpp"
#include "named_arrays.hpp"
#include "reference_element.hpp"

namespace femxdem {

inline constexpr int kPointsPerElement = 4;

/// Shape functions of one Gauss point, gradients with respect to the reference coordinates X.
struct PointShapes {
  double weight;       ///< Gauss weight times det(dX/dxi) [m^2]
  Gradient8 dN8;       ///< (8, 2) [1/m]
  Eigen::Vector4d N4;  ///< corner functions
  Gradient4 dN4;       ///< (4, 2) [1/m]
  Point2 X;            ///< position of the point [m]
};

/// Plane strain on 8-node quadrilaterals with 2 x 2 Gauss points: kinematics and virtual power of all elements of a
/// mesh. Other formulations derive from it. It gives the unknowns, the deformation gradient at the Gauss points, and
/// the element vectors and matrices that go with it.
///
/// Everything is integrated over the reference configuration, which is the updated Lagrangian form pulled back:
/// int sigma : grad u* dv = int P : Grad u* dV with the first Piola-Kirchhoff stress P = J sigma F^-T.
/// The vector of unknowns x holds the total displacements [m], node by node (2 node + i), and then what the
/// formulation adds.
class Element {
 public:
  explicit Element(const Mesh& mesh);
  virtual ~Element() = default;

  const Mesh& mesh() const { return mesh_; }
  std::size_t points() const { return shapes_.size(); }
  const PointShapes& shapes(std::size_t point) const { return shapes_[point]; }

  /// Number of unknowns of the mesh.
  virtual int unknowns() const { return 2 * static_cast<int>(mesh_.nodes.size()); }
  /// Unknowns of element e, in the order of its vectors and matrices.
  virtual std::vector<int> dofs(int e) const;
  /// Length by which the residual of unknown i is divided to be a force [m]: 1 for displacements.
  virtual double residual_length(int i) const;
  /// Unknown of the micro gradient v_c (c = 2 i + j) at a node; -1 where there is none.
  virtual int gradient_dof(int node, int c) const;

  /// Deformation gradients (3D; plane strain: F33 = 1) of all points for the unknowns x.
  std::vector<Tensor2> deformation(const Eigen::VectorXd& x) const;
  /// Internal force of element e for the Cauchy stresses of its four points [Pa].
  virtual Eigen::VectorXd force(int e, const Eigen::VectorXd& x, std::span<const Tensor2> F,
                                std::span<const Tensor2> stress) const;
  /// What the constraints add to the force of element e on the right-hand side of a correction: r g of the augmented
  /// Lagrangian; empty without constraints.
  virtual Eigen::VectorXd constraint_force(int /*e*/, const Eigen::VectorXd& /*x*/) const { return {}; }
  /// Matrix of element e from dP/dF (Tensor4) of its four points; `exact` keeps the unsymmetric terms of the
  /// second-gradient part.
  virtual Eigen::MatrixXd matrix(int e, const Eigen::VectorXd& x, std::span<const Tensor2> F,
                                 std::span<const Tensor4> dPdF, bool exact) const;

  /// Start of a load step, also after a rejected one: x becomes the committed unknowns (increments are 0 there).
  virtual void begin_step(Eigen::VectorXd& x);
  /// Multipliers of the constraints, all elements; empty without constraints.
  virtual Eigen::VectorXd multipliers() const { return {}; }
  virtual void set_multipliers(const Eigen::VectorXd& /*values*/) {}
  /// Multipliers after the unknowns have changed to x.
  virtual void update_multipliers(const Eigen::VectorXd& /*x*/) {}
  /// Extrapolates the unknowns and multipliers of the last step, factor times, onto x (set to the committed ones
  /// before).
  virtual void extrapolate(Eigen::VectorXd& x, double factor);
  /// The trial state at x becomes the committed one.
  virtual void commit(const Eigen::VectorXd& x);
  /// Largest violation of the constraints against the step's own increment [-]; 0 without constraints.
  virtual double constraint_gap(const Eigen::VectorXd& /*x*/) const { return 0; }

  /// Committed internal state for a checkpoint, and back.
  virtual void save(NamedArrays& arrays) const;
  virtual void load(const NamedArrays& arrays);

 protected:
  Eigen::Matrix<double, 8, 2> displacements(int e, const Eigen::VectorXd& x) const;

  const Mesh& mesh_;
  std::vector<PointShapes> shapes_;  // point 4 e + q
  Eigen::VectorXd last_increment_;   // unknowns of the last committed step, counted from its start
  Eigen::VectorXd committed_;        // unknowns at the start of the step
};

}  // namespace femxdem
