// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/geometry/box.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/LU>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness::box_test {
namespace {

Box random_box(Random& random) {
  return {{random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)},
          random.uniform(-10.0, 10.0),
          random.uniform(0.05, 1.0),
          random.uniform(0.05, 1.0)};
}

Pose2 random_pose(Random& random) {
  return {{random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0)}, random.uniform(-10.0, 10.0)};
}

double distance_to_side(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& p) {
  const double along = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  return (a + along * (b - a) - p).norm();
}

double area_of_triangle(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  Eigen::Matrix2d sides;
  sides << b - a, c - a;
  return 0.5 * sides.determinant();
}

TEST(Box, CornersAreCounterClockwiseAroundItsArea) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Box box = random_box(random);
    const auto c = corners(box);
    const double area_m2 = 4.0 * box.half_length_m * box.half_width_m;
    EXPECT_NEAR(area_of_triangle(c[0], c[1], c[2]), 0.5 * area_m2, 1e-12);
    EXPECT_NEAR(area_of_triangle(c[2], c[3], c[0]), 0.5 * area_m2, 1e-12);
    EXPECT_LT((0.25 * (c[0] + c[1] + c[2] + c[3]) - box.center_m).norm(), 1e-12);
    EXPECT_NEAR((c[0] - c[1]).norm(), 2.0 * box.half_length_m, 1e-12);
    const Eigen::Vector2d x_axis(std::cos(box.psi_rad), std::sin(box.psi_rad));
    EXPECT_NEAR((c[0] - c[1]).dot(x_axis), 2.0 * box.half_length_m, 1e-12);
  }
}

TEST(Box, APoseMovesItsCorners) {
  Random random(2);
  for (int i = 0; i < 100; ++i) {
    const Box box_b = random_box(random);
    const Pose2 T_a_b = random_pose(random);
    const auto expected = corners(box_b);
    const auto moved = corners(T_a_b * box_b);
    for (std::size_t k = 0; k < 4; ++k) EXPECT_LT((moved[k] - T_a_b * expected[k]).norm(), 1e-12);
  }
}

TEST(Box, ItsEllipseHasTheMomentsOfItsArea) {
  Random random(3);
  for (int i = 0; i < 20; ++i) {
    const Box box = random_box(random);
    // Midpoints of a grid: their variance is that of the area to 1 / n^2.
    constexpr int kCells = 200;
    const Pose2 T_frame_box{box.center_m, box.psi_rad};
    Eigen::Matrix2d variance_m2 = Eigen::Matrix2d::Zero();
    for (int x = 0; x < kCells; ++x) {
      for (int y = 0; y < kCells; ++y) {
        const Eigen::Vector2d p_box(((2 * x + 1.0) / kCells - 1.0) * box.half_length_m,
                                    ((2 * y + 1.0) / kCells - 1.0) * box.half_width_m);
        const Eigen::Vector2d d = T_frame_box * p_box - box.center_m;
        variance_m2 += d * d.transpose() / (kCells * kCells);
      }
    }
    // A uniform ellipse has a quarter of its shape matrix as its variance.
    const Ellipse ellipse = moment_equal_ellipse(box);
    EXPECT_EQ(ellipse.center_m, box.center_m);
    EXPECT_LT((shape_matrix(ellipse) / 4.0 - variance_m2).norm(), 1e-4 * variance_m2.norm());

    const Box back = moment_equal_box(ellipse);
    EXPECT_EQ(back.center_m, box.center_m);
    EXPECT_EQ(back.psi_rad, box.psi_rad);
    EXPECT_NEAR(back.half_length_m, box.half_length_m, 1e-12);
    EXPECT_NEAR(back.half_width_m, box.half_width_m, 1e-12);
  }
}

TEST(Box, OffsetIsThatOfTheNearestSide) {
  Random random(4);
  for (int i = 0; i < 1000; ++i) {
    const Box box = random_box(random);
    const Eigen::Vector2d p = box.center_m + Eigen::Vector2d(random.uniform(-2.0, 2.0), random.uniform(-2.0, 2.0));
    const auto c = corners(box);
    double nearest_m = std::numeric_limits<double>::infinity();
    bool inside = true;
    for (std::size_t k = 0; k < 4; ++k) {
      nearest_m = std::min(nearest_m, distance_to_side(c[k], c[(k + 1) % 4], p));
      inside = inside && area_of_triangle(c[k], c[(k + 1) % 4], p) > 0.0;  // to the left of each side
    }
    EXPECT_NEAR(offset_m(box, p), inside ? -nearest_m : nearest_m, 1e-12);
  }
}

}  // namespace
}  // namespace situation_awareness::box_test
