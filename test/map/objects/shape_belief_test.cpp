// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/shape_belief.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include <Eigen/Cholesky>

#include "situation_awareness/detections/box_fit.hpp"
#include "situation_awareness/map/objects/object_filter.hpp"

namespace situation_awareness::shape_belief_test {
namespace {

using namespace object_state;

MapElement element_with(double box_log_odds) {
  MapElement element;
  element.box_log_odds = box_log_odds;
  element.observations = 10;
  for (ObjectEstimate* const estimate : {&element.estimate.standing, &element.estimate.moving}) {
    estimate->x.segment<2>(kPosition) << 3.0, 0.0;
    estimate->x.segment<3>(kShape) << 0.12, -0.08, 0.0;  // a face across the line of sight: rx 0.2 m, ry 0.04 m
    estimate->P = 1e-4 * Matrix8d::Identity();
  }
  return element;
}

Detection view(double log_box_ratio, Shape shape = Shape::kEllipse) {
  Detection detection;
  detection.log_box_ratio = log_box_ratio;
  detection.shape = shape;
  return detection;
}

double after(double log_odds, double log_box_ratio, int scans) {
  MapElement element = element_with(log_odds);
  for (int i = 0; i < scans; ++i) shape_update(element, view(log_box_ratio), {});
  return element.box_log_odds;
}

TEST(ShapeBelief, ANewElementBelievesItsFirstView) {
  MapElement element = element_with(kSurelyEllipse);
  element.observations = 0;
  shape_update(element, view(2.5), {});
  EXPECT_EQ(element.box_log_odds, 2.5);
}

TEST(ShapeBelief, WithoutBoxesNothingChanges) {
  MapElement element = element_with(kSurelyEllipse);
  shape_update(element, view(kSurelyEllipse), {});
  EXPECT_EQ(element.box_log_odds, kSurelyEllipse);
  EXPECT_FALSE(is_box(element));
}

// A hundred views from the same place are no hundred witnesses.
TEST(ShapeBelief, RepeatedViewsAreBelievedOnce) {
  EXPECT_NEAR(after(0.5, 1.5, 100), 1.5, 1e-12);
  EXPECT_NEAR(after(0.5, -1.5, 100), -1.5, 1e-12);
}

TEST(ShapeBelief, ABetterViewOverturnsAWorseAndNotTheOtherWayRound) {
  EXPECT_LT(after(2.0, -4.0, 20), -3.0);
  EXPECT_EQ(after(4.0, -2.0, 100), 4.0);
  EXPECT_EQ(after(-4.0, 2.0, 100), -4.0);
}

TEST(ShapeBelief, StaysBounded) {
  EXPECT_LE(after(0.0, 1e3, 100), 5.0);
  EXPECT_GE(after(0.0, -1e3 + 1.0, 100), -5.0);
}

// What was seen of the ellipse was a face: its front stays, its depth is open.
TEST(ShapeBelief, AnEllipseThatTurnsIntoABoxExtendsBehindItsFace) {
  MapElement element = element_with(-0.1);
  const auto front_m = [](const ObjectEstimate& estimate) {
    return position(estimate).x() -
           0.5 * std::sqrt(3.0) * half_width_m(ellipse_world(estimate.x), Eigen::Vector2d::UnitX());
  };
  const ObjectEstimate before = element.estimate.standing;
  shape_update(element, view(4.0), {});
  const ObjectEstimate& now = element.estimate.standing;
  EXPECT_TRUE(is_box(element));
  EXPECT_NEAR(front_m(now), front_m(before), 1e-9);
  EXPECT_GT(position(now).x(), position(before).x() + 0.1);
  EXPECT_NEAR(position(now).y(), position(before).y(), 1e-12);
  EXPECT_NEAR(half_width_m(ellipse_world(now.x), Eigen::Vector2d::UnitY()),
              half_width_m(ellipse_world(before.x), Eigen::Vector2d::UnitY()), 1e-9);
  EXPECT_GT(std::sqrt(now.P(kPosition, kPosition)), 0.1);
  EXPECT_LT(std::sqrt(now.P(kPosition + 1, kPosition + 1)), 0.02);
}

TEST(ShapeBelief, PublishesTheLikelierShapeWithItsProbability) {
  Object object;
  object.ellipse_world = {{1.0, 2.0}, 0.3, 0.4, 0.2};
  fill_shape(element_with(2.0), object);
  EXPECT_EQ(object.shape, Shape::kBox);
  EXPECT_NEAR(object.p_shape, 1.0 / (1.0 + std::exp(-2.0)), 1e-12);
  EXPECT_NEAR(object.box_world.half_length_m, 0.4 * std::sqrt(3.0) / 2.0, 1e-12);
  fill_shape(element_with(-2.0), object);
  EXPECT_EQ(object.shape, Shape::kEllipse);
  EXPECT_NEAR(object.p_shape, 1.0 / (1.0 + std::exp(-2.0)), 1e-12);
  fill_shape(element_with(kSurelyEllipse), object);
  EXPECT_EQ(object.p_shape, 1.0);
}

// What a view does not show is no error that repeats.
TEST(ShapeBelief, ErrorsThatRepeatAreThoseOfWhatTheViewShows) {
  Matrix5d R = 1e-4 * Matrix5d::Identity();
  R(0, 0) = R(2, 2) = 9.0;
  for (const Shape shape : {Shape::kEllipse, Shape::kBox}) {
    const Matrix5d repeated = view_covariance(view(0.0, shape), R);
    EXPECT_LT(repeated(0, 0), 0.12 * 0.12 + 1e-9);
    EXPECT_NEAR(repeated(1, 1), 1e-4, 1e-5);
    EXPECT_GT(Matrix5d(R - repeated).ldlt().vectorD().minCoeff(), -1e-12);
  }
}

}  // namespace
}  // namespace situation_awareness::shape_belief_test
