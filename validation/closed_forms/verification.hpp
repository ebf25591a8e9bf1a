#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace femxdem {

/// One measured quantity beside its reference; it passes when |measured - reference| <= tolerance.
struct Row {
  std::string quantity;
  double measured = std::numeric_limits<double>::quiet_NaN();
  double reference = std::numeric_limits<double>::quiet_NaN();
  double tolerance = 0;
  double order = std::numeric_limits<double>::quiet_NaN();  ///< observed order of convergence; NaN: none
};

/// A line of a figure.
struct Curve {
  std::string label;
  std::vector<double> x, y;
  bool closed_form = false;
};

struct Figure {
  std::string title, x_label, y_label;
  bool logarithmic = false;
  std::vector<Curve> curves;
};

struct Verification {
  std::vector<Row> rows;
  std::vector<Figure> figures;

  /// Adds a row whose tolerance is relative to the reference.
  void add_relative(const std::string& quantity, double measured, double reference, double tolerance,
                    double order = std::numeric_limits<double>::quiet_NaN()) {
    rows.push_back({quantity, measured, reference, tolerance * std::abs(reference), order});
  }
  void add(const std::string& quantity, double measured, double reference, double tolerance,
           double order = std::numeric_limits<double>::quiet_NaN()) {
    rows.push_back({quantity, measured, reference, tolerance, order});
  }
};

/// Order of convergence from two errors whose mesh sizes differ by `ratio`.
inline double observed_order(double coarse, double fine, double ratio = 2) {
  return std::log(std::abs(coarse / fine)) / std::log(ratio);
}

// The cases, one folder beside this file each; main.cpp names them.
Verification verify_bilinear_bar();
Verification verify_cook();
Verification verify_cylinder();
Verification verify_jaumann();
Verification verify_multiplier();
Verification verify_patch();
Verification verify_rice();
Verification verify_shear_layer();
Verification verify_single_element();

}  // namespace femxdem
