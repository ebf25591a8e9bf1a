#pragma once

#include <Eigen/Dense>
#include <memory>
#include <span>
#include <vector>

#include "element_parameters.hpp"
#include "field.hpp"
#include "mesh.hpp"
#include "named_arrays.hpp"
#include "reference_element.hpp"
#include "strain_components.hpp"

namespace femxdem {

inline constexpr int kPointsPerElement = 4;

/// Shape functions of one Gauss point, gradients with respect to the reference coordinates X.
struct PointShapes {
  double weight;       ///< of the reference volume: Gauss weight det(dX/dxi) thickness [m^2 per thickness, m^3]
  Shape8 N8;           ///< of the displacements
  Gradient8 dN8;       ///< (8, 2) [1/m]
  Eigen::Vector4d N4;  ///< corner functions
  Gradient4 dN4;       ///< (4, 2) [1/m]
  Point2 X;            ///< position of the point [m]
};

/// A state of the mesh at which forces are asked for; views of vectors that live elsewhere.
struct Configuration {
  const Eigen::VectorXd& x;            ///< unknowns
  const Eigen::VectorXd& multipliers;  ///< of the constraints [Pa]
  std::span<const Tensor2> F;          ///< of all points, Formulation::deformation(x)
};

/// The same for matrices.
struct Linearisation {
  const Eigen::VectorXd& x;
  std::span<const Tensor2> F;
  std::span<const Tensor4> dPdF;  ///< of all points [Pa]
  bool exact;                     ///< with the unsymmetric terms of the second-gradient part
  double penalty;                 ///< r of the augmented Lagrangian [Pa]
};

/// Constraint of one element, gap . (x - x_n) = 0 for its unknowns, held by one multiplier a row.
struct ElementConstraint {
  Eigen::Matrix<double, 4, 32> gap;  ///< mean over the element at the start of the step
  double volume;                     ///< of the element there [m^2]
};

/// Volume that an edge sweeps per ds, and its derivatives with respect to position and tangent (control by volume).
struct SweptVolume {
  double value;
  Point2 by_position, by_tangent;
};

/// Formulation of a whole mesh of 8-node quadrilaterals with 2 x 2 Gauss points: its unknowns, the deformation
/// gradient at the Gauss points, and the vectors and matrices of its elements. What a kinematics is stands in one
/// matrix, dF = B dx, with the components of strain that it can produce and the thickness that it integrates over.
///
/// Everything is integrated over the reference configuration, which is the updated Lagrangian form pulled back:
/// int sigma : grad u* dv = int P : Grad u* dV with the first Piola-Kirchhoff stress P = J sigma F^-T.
/// The vector of unknowns x holds the total displacements [m], node by node (2 node + i), and then, where the
/// formulation has a micro gradient, v at the corner nodes, 4 per corner, order 11, 12, 21, 22, counted from the start
/// of the step.
///
/// Forces and matrices leave it as it is; it changes when a state is committed or loaded.
class Formulation {
 public:
  virtual ~Formulation() = default;

  const Mesh& mesh() const { return mesh_; }
  std::size_t points() const { return shapes_.size(); }
  const PointShapes& shapes(std::size_t point) const { return shapes_[point]; }
  /// Components of strain that the kinematics can produce.
  const StrainComponents& strain_components() const { return components_; }

  /// Number of unknowns of the mesh.
  int unknowns() const { return unknowns_; }
  /// Number of multipliers, 4 per element in its order; 0 without constraints.
  int multipliers() const { return 4 * static_cast<int>(constraints_.size()); }
  /// Unknowns of element e, in the order of its vectors and matrices.
  std::vector<int> dofs(int e) const;
  /// Length by which the residual of unknown i is divided to be a force [m]: 1 for displacements.
  double residual_length(int i) const;
  /// Unknown of the micro gradient v_c (c = 2 i + j) at a node; -1 where there is none.
  int gradient_dof(int node, int c) const;

  /// Change of the deformation gradient of a point, row 3 i + J, from its element's displacements, column 2 a + i
  /// [1/m].
  using GradientMatrix = Eigen::Matrix<double, 9, 16, Eigen::RowMajor>;
  virtual GradientMatrix B(std::size_t point) const = 0;
  /// Volume per area of the mesh's plane at a position: 1, or the circumference.
  virtual double thickness(const Point2& position) const = 0;
  /// Of a cavity on an edge's outer side, about the origin: in the plane the area on rays from it, -1/2 x cross dx/ds.
  virtual SweptVolume swept_volume(const Point2& position, const Point2& tangent) const;
  /// Unit of a swept volume.
  virtual const char* volume_unit() const { return "m2"; }

  /// Deformation gradients (3D) of all points for the unknowns x: I + B x.
  std::vector<Tensor2> deformation(const Eigen::VectorXd& x) const;
  /// Internal force of element e from the Cauchy stresses of all points [Pa].
  virtual Eigen::VectorXd force(int e, const Configuration& at, std::span<const Tensor2> stress) const;
  /// Matrix of element e.
  virtual Eigen::MatrixXd matrix(int e, const Linearisation& at) const;

  /// What the constraints add to the force of element e on the right-hand side of a correction: r g of the augmented
  /// Lagrangian; empty without constraints.
  Eigen::VectorXd constraint_force(int e, const Eigen::VectorXd& x, double penalty) const;
  /// Multipliers after the unknowns have changed to x: lambda + r g.
  Eigen::VectorXd updated_multipliers(const Eigen::VectorXd& multipliers, const Eigen::VectorXd& x,
                                      double penalty) const;
  /// Largest violation of the constraints against the step's own increment [-]; 0 without constraints.
  double constraint_gap(const Eigen::VectorXd& x) const;

  /// Unknowns x_n at the start of the step.
  const Eigen::VectorXd& start() const { return start_; }
  /// The state at x becomes the start of the next step; unknowns that count from it become 0 in x.
  virtual void commit(Eigen::VectorXd& x);
  /// Committed internal state for a checkpoint, and back.
  virtual void save(NamedArrays& arrays) const;
  virtual void load(const NamedArrays& arrays);

  /// What the formulation knows of the committed state beyond displacements and stresses, for the results.
  virtual std::vector<Field> node_fields() const { return {}; }
  virtual std::vector<Field> point_fields() const { return {}; }

 protected:
  enum class MicroGradient { none, at_corners };
  /// mesh is kept by reference. Throws UserError at an element that is turned inside out.
  Formulation(const Mesh& mesh, StrainComponents components, MicroGradient micro_gradient = MicroGradient::none);

  /// Rows of B within the plane: du_i / dX_J.
  GradientMatrix in_plane(std::size_t point) const;
  /// Force and matrix of the displacements of element e: sum w B^T P, sum w B^T (dP/dF) B.
  Eigen::Matrix<double, 16, 1> material_force(int e, std::span<const Tensor2> F, std::span<const Tensor2> stress) const;
  Eigen::Matrix<double, 16, 16> material_matrix(int e, std::span<const Tensor4> dPdF) const;

  using Vector32 = Eigen::Matrix<double, 32, 1>;
  /// Change of the unknowns of a constrained element over the step.
  Vector32 local_increment(int e, const Eigen::VectorXd& x) const;

  const Mesh& mesh_;
  std::vector<PointShapes> shapes_;             // point 4 e + q
  std::vector<ElementConstraint> constraints_;  // one per element, or none

 private:
  StrainComponents components_;
  std::vector<int> rows_;    // of B that the components touch, ascending
  std::vector<int> corner_;  // number of a node among the corner nodes, -1 elsewhere; empty without micro gradient
  int unknowns_;
  double mean_size_;       // of the elements [m]
  Eigen::VectorXd start_;  // unknowns at the start of the step
};

/// The formulation of an [element] table on its mesh, which is kept by reference. Throws UserError on a mesh that it
/// cannot work on.
std::unique_ptr<Formulation> make_formulation(const ElementParameters& e, const Mesh& mesh);

}  // namespace femxdem
