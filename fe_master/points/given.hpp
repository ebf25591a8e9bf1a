#pragma once

#include <limits>

namespace femxdem {

/// Marks a number that the case does not give.
inline constexpr double kNotGiven = std::numeric_limits<double>::quiet_NaN();
/// Whether a number of the case is given.
inline bool is_given(double value) { return value == value; }

}  // namespace femxdem
