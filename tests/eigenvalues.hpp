#pragma once
#include <Eigen/Core>

namespace femxdem {

/// Of a symmetric matrix, ascending. Compiled once for all tests: Eigen's solver takes the compiler several seconds.
Eigen::VectorXd eigenvalues(const Eigen::MatrixXd& symmetric);

}  // namespace femxdem
