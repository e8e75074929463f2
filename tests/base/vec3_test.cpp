#include "src/base/vec3.h"

#include <gtest/gtest.h>

#include "src/base/check.h"

namespace cnerf {
namespace {

constexpr Mat3d kMatrix = {{{2, 1, 0}, {0, 3, -1}, {1, 0, 4}}};

void expect_near(Vec3d a, Vec3d b, double tolerance = 1e-14) {
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(a[axis], b[axis], tolerance) << "axis " << axis;
}

TEST(Vec3, CrossIsRightHandedAndAcross) {
  EXPECT_EQ(cross(Vec3d{1, 0, 0}, Vec3d{0, 1, 0}), (Vec3d{0, 0, 1}));
  const Vec3d a = {1, 2, 3};
  const Vec3d b = {-2, 0.5, 1};
  EXPECT_NEAR(dot(cross(a, b), a), 0, 1e-14);
  EXPECT_NEAR(dot(cross(a, b), b), 0, 1e-14);
}

TEST(Vec3, NormalizedHasUnitLength) {
  EXPECT_NEAR(length(normalized(Vec3d{3, -4, 12})), 1, 1e-15);
}

TEST(Mat3, RowsAndColumns) {
  EXPECT_EQ(kMatrix.column(1), (Vec3d{1, 3, 0}));
  EXPECT_EQ(Mat3d::from_columns(kMatrix.column(0), kMatrix.column(1), kMatrix.column(2)), kMatrix);
  EXPECT_EQ(kMatrix.transposed().transposed(), kMatrix);
  EXPECT_EQ(kMatrix.transposed().rows[0], kMatrix.column(0));
}

TEST(Mat3, ProductAppliesTheRightOneFirst) {
  const Mat3d quarter_turn = {{{0, -1, 0}, {1, 0, 0}, {0, 0, 1}}};
  const Vec3d v = {1, 2, 3};
  expect_near((kMatrix * quarter_turn) * v, kMatrix * (quarter_turn * v));
  EXPECT_NE(kMatrix * quarter_turn, quarter_turn * kMatrix);
}

TEST(Mat3, InverseAndDeterminant) {
  EXPECT_DOUBLE_EQ(kMatrix.determinant(), 2 * (3 * 4 - 0) - 1 * (0 * 4 + 1 * 1));
  const Mat3d product = kMatrix * kMatrix.inverse();
  for (int row = 0; row < 3; ++row) expect_near(product.rows[row], Mat3d::identity().rows[row]);
}

TEST(Affine, ProductsReadByCancellation) {
  const Affined b_from_a = {kMatrix, {1, 2, 3}};
  const Affined c_from_b = {{{{0, -1, 0}, {1, 0, 0}, {0, 0, 2}}}, {-1, 0, 5}};
  const Vec3d p = {0.3, -0.2, 0.9};
  expect_near((c_from_b * b_from_a).point(p), c_from_b.point(b_from_a.point(p)));
  expect_near((c_from_b * b_from_a).direction(p), c_from_b.direction(b_from_a.direction(p)));
}

TEST(Affine, InverseGoesBackAndDirectionsIgnoreTranslation) {
  const Affined b_from_a = {kMatrix, {1, 2, 3}};
  const Vec3d p = {0.3, -0.2, 0.9};
  expect_near(b_from_a.inverse().point(b_from_a.point(p)), p);
  expect_near(b_from_a.direction(p), b_from_a.point(p) - b_from_a.point({0, 0, 0}));
}

TEST(Check, SaysWhatWasComparedAndIsSilentOtherwise) {
  EXPECT_NO_THROW(CNERF_CHECK_EQ(2 + 2, 4));
  try {
    CNERF_CHECK_EQ(2 + 2, 5);
    FAIL() << "no error";
  } catch (const ContractError& error) {
    EXPECT_NE(std::string(error.what()).find("4 against 5"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace cnerf
