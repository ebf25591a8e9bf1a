#pragma once

#include <memory>
#include <string>

#include "analytic_points.hpp"
#include "loads.hpp"
#include "nonlinear_solver.hpp"
#include "plane_strain_q8.hpp"
#include "second_gradient_q8.hpp"

namespace femxdem {

/// Finite elements on laws in closed form with their solver: what a run holds, for tests.
struct SofteningProblem {
  std::unique_ptr<Mesh> mesh;  // has an address of its own: the element refers to it
  std::unique_ptr<Formulation> element;
  std::unique_ptr<AnalyticPoints> points;
  std::unique_ptr<Loads> loads;
  std::unique_ptr<NonlinearSolver> solver;

  /// Element, points and loads are there: makes the solver.
  void start(const SolverParameters& parameters) {
    solver = std::make_unique<NonlinearSolver>(*element, *points, *loads, parameters);
  }

  double reaction(const std::string& edge, int component) const {
    double sum = 0;
    const Equilibrium& now = solver->committed();
    for (const int node : edge_nodes(*mesh, edge)) {
      sum += now.internal[2 * node + component] - now.external[2 * node + component];
    }
    return sum;
  }
};

inline SolverParameters solver_parameters(GlobalOperator global_operator, double tolerance, int max_iterations) {
  SolverParameters p;
  p.global_operator = global_operator;
  p.tolerance = tolerance;
  p.displacement_tolerance = 0.1;
  p.max_iterations = max_iterations;
  return p;
}

/// What a series of steps cost; a step that fails is halved, down to 1/64 of the series' own.
struct SeriesCost {
  int evaluations = 0, steps = 0, failures = 0, largest = 0;
  bool finished = true;
  std::string reason;  ///< of the last failure
};

inline SeriesCost run_to(SofteningProblem& problem, double end_time, double step) {
  SeriesCost cost;
  double dt = step;
  while (problem.solver->committed().time < end_time * (1 - 1e-9)) {
    const double left = end_time - problem.solver->committed().time;
    const StepResult result = problem.solver->solve_step(std::min(dt, left));
    cost.evaluations += result.evaluations;
    if (result.converged) {
      ++cost.steps;
      cost.largest = std::max(cost.largest, result.evaluations);
      dt = std::min(step, 1.3 * dt);
      continue;
    }
    ++cost.failures;
    cost.reason = result.reason;
    dt /= 2;
    cost.finished = dt >= step / 64;
    if (!cost.finished) break;
  }
  return cost;
}

/// Bilinear softening bar of Chambon, Caillerie and El Hassan (1998): A1 = 100, A2 = -10, e_l = 0.01, D = 0.04, L = 1,
/// n elements, only u_1 and v_11 free; the middle element is weaker by 1e-4. The right end is at `end` at time 1; with
/// end = 0 it is pulled by a traction equal to the time instead, whose factor is released.
inline SofteningProblem bilinear_bar(int n, double end, const SolverParameters& parameters) {
  SofteningProblem p{std::make_unique<Mesh>(rectangle_mesh(1, 1.0 / n, n, 1)), {}, {}, {}, {}};
  p.element = std::make_unique<SecondGradientQ8>(*p.mesh, one_parameter_law(0.04));
  std::vector<AnalyticLaw> laws(p.element->points(), BilinearLaw{100, -10, 0.01, 0, 0});
  for (int q = 0; q < kPointsPerElement; ++q)
    laws[kPointsPerElement * (n / 2) + q] = BilinearLaw{100, -10, 0.01 * (1 - 1e-4), 0, 0};
  p.points = std::make_unique<AnalyticPoints>(std::move(laws));
  p.loads = std::make_unique<Loads>(*p.element);
  for (int node = 0; node < static_cast<int>(p.mesh->nodes.size()); ++node) {
    p.loads->prescribe(2 * node + 1, [](double) { return 0.0; });
    for (int c = 1; c < 4; ++c) {
      if (const int dof = p.element->gradient_dof(node, c); dof >= 0)
        p.loads->prescribe(dof, [](double) { return 0.0; });
    }
  }
  for (const int node : edge_nodes(*p.mesh, "left")) p.loads->prescribe(2 * node, [](double) { return 0.0; });
  if (end > 0) {
    for (const int node : edge_nodes(*p.mesh, "right")) {
      p.loads->prescribe(2 * node, [end](double t) { return end * t; });
    }
  } else {
    Load traction;
    traction.edge = "right";
    traction.kind = LoadKind::traction;
    traction.component = Component::x;
    traction.value = 1;
    traction.table = {{0, 0}, {10, 10}};
    p.loads->add(traction);
    p.loads->release({"right"});
  }
  p.start(parameters);
  return p;
}

/// A softening law in every point, a weaker one in one spot.
inline std::vector<AnalyticLaw> softening_laws(const Formulation& element, double hardening) {
  constexpr double kDegree = 0.017453292519943295;
  const DruckerPragerLaw law{3e7, 0.2, 5e4, 25 * kDegree, 10 * kDegree, hardening, 1e4, 1e5};
  DruckerPragerLaw weak = law;
  weak.cohesion *= 0.8;
  std::vector<AnalyticLaw> laws(element.points(), law);
  for (std::size_t i = 0; i < laws.size(); ++i) {
    const Point2 X = element.shapes(i).X;
    if (X.x() > 0.25 && X.x() < 0.375 && X.y() > 0.75 && X.y() < 0.875) laws[i] = weak;
  }
  return laws;
}

/// Biaxial test W x H = 1 m x 2 m, nx x 2 nx elements, Drucker-Prager with softening cohesion, sides under sigma_0 =
/// 1e5 Pa, one region of W / 8 with 20 % less cohesion. D: second-gradient modulus [N], 0: first gradient. The top goes
/// down by 1e-3 of the height in a time of 1.
inline SofteningProblem softening_biaxial(int nx, double D, const SolverParameters& parameters,
                                          double hardening = -5e5) {
  SofteningProblem p{std::make_unique<Mesh>(rectangle_mesh(1, 2, nx, 2 * nx)), {}, {}, {}, {}};
  if (D > 0) {
    p.element = std::make_unique<SecondGradientQ8>(*p.mesh, one_parameter_law(D));
  } else {
    p.element = std::make_unique<PlaneStrainQ8>(*p.mesh);
  }
  p.points = std::make_unique<AnalyticPoints>(softening_laws(*p.element, hardening));
  p.loads = std::make_unique<Loads>(*p.element);
  for (const int node : edge_nodes(*p.mesh, "bottom")) p.loads->prescribe(2 * node + 1, [](double) { return 0.0; });
  for (const int node : edge_nodes(*p.mesh, "top"))
    p.loads->prescribe(2 * node + 1, [](double t) { return -2e-3 * t; });
  p.loads->prescribe(2 * edge_nodes(*p.mesh, "bottom").front(), [](double) { return 0.0; });
  for (const char* edge : {"left", "right"}) {
    Load pressure;
    pressure.edge = edge;
    pressure.kind = LoadKind::pressure;
    pressure.value = 1e5;
    p.loads->add(pressure);
  }
  p.start(parameters);
  return p;
}

}  // namespace femxdem
