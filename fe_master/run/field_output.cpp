#include "field_output.hpp"

#include "point_fields.hpp"

namespace femxdem {
namespace {

std::vector<Tensor2> stresses(const Equilibrium& state) {
  std::vector<Tensor2> stress;
  for (const Response& r : state.responses) stress.push_back(r.stress);
  return stress;
}

/// Out-of-balance forces of the free displacements [N/m]; the reactions are not among them.
Field residual_field(const Problem& problem, const Equilibrium& now) {
  Eigen::VectorXd out_of_balance = now.external - now.internal;
  for (const int dof : problem.loads().prescribed_dofs()) out_of_balance[dof] = 0;
  const Eigen::Index count = 2 * static_cast<Eigen::Index>(problem.mesh().nodes.size());
  return {"residual", 2, {out_of_balance.data(), out_of_balance.data() + count}};
}

Field element_residual_field(const Problem& problem, const Equilibrium& now) {
  Field field{"element_residual", 1, {}};
  for (const double value : problem.solver().element_residuals(now))
    field.values.insert(field.values.end(), kPointsPerElement, value);
  return field;
}

}  // namespace

std::vector<Point2> point_positions(const Formulation& formulation) {
  std::vector<Point2> X;
  for (std::size_t p = 0; p < formulation.points(); ++p) X.push_back(formulation.shapes(p).X);
  return X;
}

FieldStep field_step(int step, double end_time, const Problem& problem, const Equilibrium& before) {
  const Equilibrium& now = problem.solver().committed();
  const PointOperators& operators = problem.solver().operators();
  const std::vector<Tensor2> stress = stresses(now);
  std::vector<PointReport> reports;
  for (const Response& r : now.responses) reports.push_back(r.report);
  FieldStep fields{step, now.time, now.time / end_time, {}, point_fields(now.F, stress, reports)};
  fields.point_fields.push_back(second_order_work(before.F, stresses(before), now.F, stress));
  fields.point_fields.push_back({"least_tangent_eigenvalue", 1, operators.least_eigenvalues()});
  if (auto values = operators.acoustic_determinants(now.F, now.responses); !values.empty())
    fields.point_fields.push_back({"acoustic_determinant", 1, std::move(values)});
  fields.point_fields.push_back(element_residual_field(problem, now));
  const Eigen::Index count = 2 * static_cast<Eigen::Index>(problem.mesh().nodes.size());
  fields.node_fields = {{"displacement", 2, {now.x.data(), now.x.data() + count}}, residual_field(problem, now)};
  for (Field& field : problem.formulation().node_fields()) fields.node_fields.push_back(std::move(field));
  for (Field& field : problem.formulation().point_fields()) fields.point_fields.push_back(std::move(field));
  return fields;
}

}  // namespace femxdem
