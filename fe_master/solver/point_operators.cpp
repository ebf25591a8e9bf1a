#include "point_operators.hpp"

#include <algorithm>

#include "localisation.hpp"

namespace femxdem {
namespace {

constexpr double kProbe = 0.01;       // probe over the step's strain: smaller ones drown in the DEM's noise
constexpr double kLeastProbe = 1e-6;  // [-]

bool all_answered(std::span<const Response> responses) {
  return std::none_of(responses.begin(), responses.end(), [](const Response& r) { return r.failure.has_value(); });
}

}  // namespace

PointOperators::PointOperators(const SolverParameters& parameters, std::span<const Response> reference,
                               const StrainComponents& components)
    : parameters_(parameters),
      components_(static_cast<int>(components.size())),
      F_n_(reference.size(), Tensor2::Identity()) {
  LearningLimits limits{.min = parameters.qn_min, .max = parameters.qn_max, .skew = parameters.qn_skew};
  if (is_given(parameters.qn_first)) limits.first = parameters.qn_first;
  if (is_given(parameters.qn_scatter)) limits.scatter = parameters.qn_scatter;
  limits.noise = parameters.qn_noise;
  for (const Response& r : reference) {
    elastic_.push_back(parameters.operator_scale * r.stiffness);
    elastic_acoustic_determinants_.push_back(min_acoustic_determinant(r.stiffness));
    learned_.emplace_back(r.stiffness, components, limits);
  }
}

Operator PointOperators::wanted() const {
  switch (parameters_.global_operator) {
    case GlobalOperator::tangent:
      return Operator::tangent;
    case GlobalOperator::elastic:
      return parameters_.refresh == Refresh::frozen ? Operator::none : Operator::elastic;
    default:
      return Operator::none;
  }
}

void PointOperators::begin_step(std::span<const Tensor2> F, std::span<const Response> responses) {
  F_n_.assign(F.begin(), F.end());
  for (std::size_t p = 0; p < responses.size(); ++p) {
    learned_[p].begin_step(F[p], responses[p].stress);
    if (wanted() == Operator::elastic) elastic_[p] = parameters_.operator_scale * responses[p].stiffness;
  }
}

Misfit PointOperators::learn(std::span<const Tensor2> F, std::span<const Response> responses) {
  Misfit sum;
  for (std::size_t p = 0; p < responses.size(); ++p) {
    if (parameters_.global_operator == GlobalOperator::quasi_newton) {
      const Misfit misfit = learned_[p].learn(F[p], responses[p].stress);
      sum.missed += misfit.missed;
      sum.expected += misfit.expected;
    }
    if (symmetric() && parameters_.refresh == Refresh::iteration) {
      elastic_[p] = parameters_.operator_scale * responses[p].stiffness;
    }
  }
  return sum;
}

int PointOperators::probe(MaterialPoints& points, std::span<const Tensor2> F, std::span<const Response> responses) {
  if (parameters_.global_operator != GlobalOperator::perturbation) return 0;
  std::vector<StrainProbe> probes;
  for (std::size_t p = 0; p < F.size(); ++p) {
    const double step = (F[p] - F_n_[p]).norm();
    probes.push_back(learned_[p].start_probe(F[p], responses[p].stress, std::max(kProbe * step, kLeastProbe)));
  }
  for (int component = 0; component < components_; ++component) {
    std::vector<Tensor2> probed;
    for (std::size_t p = 0; p < F.size(); ++p) probed.push_back(learned_[p].probe(probes[p], F[p], component));
    const std::vector<Response> answers = points.evaluate(probed, Operator::none);
    if (!all_answered(answers)) return component + 1;
    for (std::size_t p = 0; p < F.size(); ++p) learned_[p].record(probes[p], probed[p], answers[p].stress, component);
  }
  for (std::size_t p = 0; p < F.size(); ++p) learned_[p].finish_probe(probes[p]);
  return components_;
}

std::vector<Tensor4> PointOperators::piola(std::span<const Tensor2> F, std::span<const Response> responses) const {
  std::vector<Tensor4> dPdF;
  dPdF.reserve(F.size());
  for (std::size_t p = 0; p < F.size(); ++p) {
    switch (parameters_.global_operator) {
      case GlobalOperator::elastic:
        dPdF.push_back(piola_elastic(elastic_[p], F[p]));
        break;
      case GlobalOperator::tangent:
        dPdF.push_back(piola_tangent(responses[p].stiffness, responses[p].stress, F[p]));
        break;
      default:
        dPdF.push_back(learned_[p].piola(F[p], responses[p].stress));
    }
  }
  return dPdF;
}

std::vector<double> PointOperators::acoustic_determinants(std::span<const Tensor2> F,
                                                          std::span<const Response> responses) const {
  std::vector<double> ratios;
  if (symmetric()) return ratios;
  const std::vector<Tensor4> dPdF = piola(F, responses);  // N . dP/dF . N has the sign of the spatial one: N ~ F^T n
  for (std::size_t p = 0; p < dPdF.size(); ++p)
    ratios.push_back(min_acoustic_determinant(dPdF[p]) / elastic_acoustic_determinants_[p]);
  return ratios;
}

std::vector<double> PointOperators::least_eigenvalues() const {
  std::vector<double> values;
  for (const LearnedTangent& t : learned_) values.push_back(t.least_eigenvalue());
  return values;
}

void PointOperators::save(NamedArrays& arrays) const {
  std::vector<double> values;
  for (const LearnedTangent& t : learned_) t.save(values);
  arrays.emplace_back("operators.learned", std::move(values));
  std::vector<double> elastic;
  for (const Tensor4& C : elastic_) elastic.insert(elastic.end(), C.data(), C.data() + C.size());
  arrays.emplace_back("operators.elastic", std::move(elastic));
}

void PointOperators::load(const NamedArrays& arrays) {
  const auto& values = find_array(arrays, "operators.learned");
  std::size_t position = 0;
  for (LearnedTangent& t : learned_) t.load(values, position);
  const auto& elastic = find_array(arrays, "operators.elastic");
  for (std::size_t p = 0; p < elastic_.size(); ++p) std::copy_n(&elastic.at(81 * p), 81, elastic_[p].data());
}

}  // namespace femxdem
