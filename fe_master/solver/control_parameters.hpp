#pragma once

#include <string>
#include <vector>

#include "given.hpp"

namespace femxdem {

enum class ControlMode { time, measure, automatic };
enum class Measure { displacement_x, displacement_y, opening, volume };
struct ControlParameters {
  double end_time = kNotGiven;     ///< [s]
  double step = kNotGiven;         ///< first step [s]
  double min_step = kNotGiven;     ///< smallest step: below it the run ends, not converged [s]
  double max_step = kNotGiven;     ///< [s]
  double growth = 1.3;             ///< factor on the step after a quick one [-]
  int max_iterations_to_grow = 6;  ///< a step is quick up to so many iterations
  double cut = 0.5;                ///< factor on the step after a failure [-]
  ControlMode mode = ControlMode::time;
  std::vector<std::string> loads;  ///< edges whose tractions and pressures get an unknown factor, unless mode is time
  Measure measure = Measure::opening;  ///< what is prescribed in its place (ControlMeasure)
  std::string measure_edge;
  std::string against_edge;  ///< whose measure is subtracted, or empty
  double rate = kNotGiven;   ///< of the measure [m/s, m^2/s, m^3/s]
};

}  // namespace femxdem
