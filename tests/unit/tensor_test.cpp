#include "tensor.hpp"

#include <gtest/gtest.h>

#include "material_points.hpp"

namespace femxdem {
namespace {

Tensor2 rotation(double angle, const Eigen::Vector3d& axis) {
  return Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
}

const Tensor2 kR = rotation(2.3, {1, -2, 0.5});
const Tensor2 kU = (Tensor2() << 1.3, 0.2, -0.1, 0.2, 0.7, 0.3, -0.1, 0.3, 1.1).finished();

Tensor4 numbered() {
  Tensor4 C;
  for (int row = 0; row < 9; ++row)
    for (int column = 0; column < 9; ++column) C(row, column) = std::sin(1 + 9 * row + column);
  return C;
}

TEST(Tensor, PolarDecompositionFindsTheFactors) {
  const auto [R, U] = polar_decomposition(kR * kU);
  EXPECT_LT((R - kR).norm(), 1e-14);
  EXPECT_LT((U - kU).norm(), 1e-14);
  EXPECT_EQ(U, U.transpose());
}

TEST(Tensor, PolarDecompositionHoldsAtExtremeStretch) {
  const Tensor2 stretch = Eigen::Vector3d(1e6, 1, 1e-6).asDiagonal();
  const Tensor2 F = kR * stretch;
  const auto [R, U] = polar_decomposition(F);
  EXPECT_LT((R.transpose() * R - Tensor2::Identity()).norm(), 1e-14);
  EXPECT_LT((R * U - F).norm(), 1e-9);
  EXPECT_NEAR(R.determinant(), 1, 1e-14);
}

TEST(Tensor, PolarDecompositionKeepsPlaneStrainPlane) {
  const Tensor2 F = (Tensor2() << 1.1, 0.4, 0, -0.2, 0.8, 0, 0, 0, 1).finished();
  const auto [R, U] = polar_decomposition(F);
  EXPECT_EQ(U(2, 2), 1);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(U(i, 2), 0);
    EXPECT_EQ(R(2, i), 0);
  }
}

TEST(Tensor, StiffnessRotatesAsItsDefinition) {
  const Tensor4 C = numbered();
  const Tensor4 rotated = rotate(C, kR);
  const Tensor2 H = kU + kR;
  // C'(H) = R C(R^T H R) R^T for every H
  const auto apply = [](const Tensor4& T, const Tensor2& G) {
    Tensor2 result = Tensor2::Zero();
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        for (int k = 0; k < 3; ++k)
          for (int l = 0; l < 3; ++l) result(i, j) += T(pair(i, j), pair(k, l)) * G(k, l);
    return result;
  };
  EXPECT_LT((apply(rotated, H) - rotate(apply(C, rotate(H, kR.transpose())), kR)).norm(), 1e-13);
}

TEST(Tensor, IsotropicStiffnessIsIsotropic) {
  const Tensor4 C = isotropic_stiffness(3, 2);
  EXPECT_LT((rotate(C, kR) - C).norm(), 1e-13);
  EXPECT_EQ(C(pair(0, 0), pair(0, 0)), 7);  // lambda + 2 G
  EXPECT_EQ(C(pair(0, 0), pair(1, 1)), 3);  // lambda
  EXPECT_EQ(C(pair(0, 1), pair(1, 0)), 2);  // G
  EXPECT_EQ(C(pair(0, 1), pair(0, 2)), 0);
}

TEST(PointReport, IsFilledByName) {
  PointReport report;
  report["porosity"] = 0.4;
  EXPECT_EQ(std::as_const(report)["porosity"], 0.4);
  EXPECT_EQ(report.values[6], 0.4);
  EXPECT_THROW(report["porosty"], std::out_of_range);
}

}  // namespace
}  // namespace femxdem
