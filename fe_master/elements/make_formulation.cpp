#include "axisymmetric_q8.hpp"
#include "plane_strain_q8.hpp"
#include "second_gradient_q8.hpp"

namespace femxdem {

std::unique_ptr<Formulation> make_formulation(const ElementParameters& e, const Mesh& mesh) {
  if (e.type == ElementType::axisymmetric) return std::make_unique<AxisymmetricQ8>(mesh);
  if (e.type == ElementType::q8) return std::make_unique<PlaneStrainQ8>(mesh);
  return std::make_unique<SecondGradientQ8>(mesh, make_double_stiffness(e));
}

}  // namespace femxdem
