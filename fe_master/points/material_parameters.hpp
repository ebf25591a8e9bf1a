#pragma once

#include "given.hpp"

namespace femxdem {

enum class MaterialType { volume_element, elastic, jaumann, von_mises, drucker_prager, bilinear };
struct MaterialParameters {
  MaterialType type = MaterialType::volume_element;
  double young = kNotGiven;         ///< Young's modulus [Pa]
  double poisson = 0.25;            ///< Poisson's ratio [-]
  double yield_stress = kNotGiven;  ///< von Mises, uniaxial [Pa]
  double hardening = 0.0;           ///< d(yield stress or cohesion)/d(plastic strain) [Pa], negative: softening
  double residual_stress = 0.0;     ///< least yield stress or cohesion under softening [Pa]
  double friction_angle = 30.0;     ///< Drucker-Prager [deg]
  double dilatancy_angle = 0.0;     ///< Drucker-Prager [deg]
  double cohesion = kNotGiven;      ///< Drucker-Prager [Pa]
  double A1 = kNotGiven;            ///< bilinear bar law: first slope [Pa]
  double A2 = kNotGiven;            ///< bilinear bar law: second slope [Pa], negative: softening
  double limit_strain = kNotGiven;  ///< bilinear bar law: strain e_l at which the slope changes [-]
  double initial_pressure = 0.0;    ///< isotropic stress of the reference state [Pa], compression positive
};

}  // namespace femxdem
