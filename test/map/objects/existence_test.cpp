// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/existence.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::existence_test {
namespace {

using namespace object_state;

constexpr double kLn4 = 1.3862943611198906;
constexpr double kScan_s = 0.05;
const Detection kWhole;
const Detection kPiece = [] {
  Detection detection;
  detection.hidden_end = true;
  return detection;
}();

/// A standing element of 0.3 m and 0.2 m, with a position sigma of `sigma_m` in each direction.
MapElement element_at(const Eigen::Vector2d& center_m, double sigma_m) {
  MapElement element;
  element.id = 1;
  for (ObjectEstimate* estimate : {&element.estimate.standing, &element.estimate.moving}) {
    estimate->x.segment<2>(kPosition) = center_m;
    estimate->x.segment<3>(kShape) << 0.25, 0.05, 0.0;
    estimate->P.diagonal().segment<2>(kPosition).setConstant(sigma_m * sigma_m);
  }
  element.estimate.p_moving = 0.01;
  return element;
}

FreeSpace free_space_of(const std::vector<Ellipse>& things) {
  LevelScene scene;
  scene.ellipses = things;
  return free_space(project_horizontally(scene.scan(), Eigen::Isometry3d::Identity()));
}

TEST(Existence, LogOddsAndProbabilityAreInverse) {
  for (const double p : {0.001, 0.2, 0.5, 0.75, 0.999}) EXPECT_NEAR(probability(log_odds(p)), p, 1e-15);
  EXPECT_EQ(log_odds(0.5), 0.0);
  EXPECT_EQ(probability(-std::numeric_limits<double>::infinity()), 0.0);
}

TEST(Existence, AnElementIsTentativeThenConfirmedThenLostAndConfirmedAgain) {
  const ObjectMapParams params;  // born at 0.2, confirmed from 0.75 on
  MapElement element = element_at({3.0, 0.0}, 0.01);
  begin_existence(element, params);
  EXPECT_EQ(element.state, TrackState::kTentative);
  EXPECT_NEAR(element.log_odds, std::log(0.25), 1e-12);
  age(element, nanoseconds(0.9));
  EXPECT_EQ(element.state, TrackState::kTentative) << "only what is confirmed can be lost";

  EXPECT_FALSE(detection_update(element, kWhole, kScan_s, params));
  EXPECT_TRUE(detection_update(element, kWhole, kScan_s, params));  // 4 * 4 / 4: odds of 4
  EXPECT_EQ(element.state, TrackState::kConfirmed);
  EXPECT_FALSE(detection_update(element, kWhole, kScan_s, params)) << "it was before";
  EXPECT_NEAR(element.log_odds, std::log(0.25) + 3.0 * kLn4, 1e-12);

  element.last_seen_ns = nanoseconds(10.0);
  age(element, nanoseconds(10.5));
  EXPECT_EQ(element.state, TrackState::kConfirmed);
  age(element, nanoseconds(10.5) + 1);
  EXPECT_EQ(element.state, TrackState::kLost);
  EXPECT_FALSE(detection_update(element, kWhole, kScan_s, params));
  EXPECT_EQ(element.state, TrackState::kConfirmed);
}

// A robot must not drive for three scans towards what 30 beams show.
TEST(Existence, WhatHasManyHitsIsConfirmedByTheSecondScan) {
  const ObjectMapParams params;
  for (const Shape shape : {Shape::kEllipse, Shape::kBox}) {
    Detection detection;
    detection.shape = shape;
    detection.beams = 8;
    detection.ellipse_level = {{3.0, 0.0}, 0.0, 0.2, 0.1};
    MapElement element = element_at({3.0, 0.0}, 0.01);
    begin_existence(element, params);
    EXPECT_TRUE(detection_update(element, detection, kScan_s, params));
    detection.beams = 7;
    MapElement other = element_at({3.0, 0.0}, 0.01);
    begin_existence(other, params);
    EXPECT_FALSE(detection_update(other, detection, kScan_s, params));
  }
}

TEST(Existence, AHighBirthProbabilityConfirmsAtOnce) {
  ObjectMapParams params;
  params.birth_probability = 0.8;
  MapElement element = element_at({3.0, 0.0}, 0.01);
  begin_existence(element, params);
  EXPECT_EQ(element.state, TrackState::kConfirmed);
}

TEST(Existence, ADetectionWithAHiddenEndCountsLessAndLogOddsAreBounded) {
  ObjectMapParams params;
  params.hidden_observation_weight = 0.25;
  MapElement element = element_at({3.0, 0.0}, 0.01);
  detection_update(element, kPiece, kScan_s, params);
  EXPECT_NEAR(element.log_odds, 0.25 * kLn4, 1e-12);
  for (int i = 0; i < 100; ++i) detection_update(element, kWhole, kScan_s, params);
  EXPECT_NEAR(probability(element.log_odds), 0.999, 1e-4);
}

// Scans far apart do not repeat each other's errors.
TEST(Existence, OfFewerScansPerSecondOneWithAHiddenEndCountsMore) {
  ObjectMapParams params;
  params.hidden_observation_weight = 0.25;
  double before = 0.0;
  for (const double step_s : {0.025, 0.1, 0.15, 0.2, 1.0}) {
    MapElement element = element_at({3.0, 0.0}, 0.01);
    detection_update(element, kPiece, step_s, params);
    EXPECT_GE(element.log_odds, before);
    before = element.log_odds;
    if (step_s <= 0.1) {
      EXPECT_NEAR(element.log_odds, 0.25 * kLn4, 1e-12);
    }
  }
  EXPECT_NEAR(before, kLn4, 1e-12);
}

TEST(Existence, DetectionProbabilityFallsWithOcclusionAndPositionUncertainty) {
  const double P_D = 0.6;
  const Ellipse hider{{1.5, 0.0}, 0.0, 0.4, 0.4};
  const Ellipse thing{{3.0, 0.0}, 0.0, 0.3, 0.2};
  const MapElement certain = element_at(thing.center_m, 0.0);
  const auto expected = [&](const MapElement& element, const std::vector<Ellipse>& things) {
    return expect_detection(element, {}, free_space_of(things), P_D);
  };
  EXPECT_EQ(expected(certain, {}).sight, Sight::kSeenThrough);
  EXPECT_EQ(expected(certain, {thing}).sight, Sight::kHit);
  EXPECT_EQ(expected(certain, {thing, hider}).sight, Sight::kHidden);
  EXPECT_NEAR(expected(certain, {}).probability, P_D, 1e-12);
  EXPECT_NEAR(expected(certain, {thing}).probability, P_D, 1e-12);
  EXPECT_EQ(expected(certain, {thing, hider}).probability, 0.0);
  // rx ry / (rx ry + sigma^2) of it.
  const double sigma_m = std::sqrt(0.3 * 0.2);
  EXPECT_NEAR(expected(element_at(thing.center_m, sigma_m), {}).probability, 0.5 * P_D, 1e-9);

  // The same from anywhere.
  const Pose2 T_world_level{{2.0, -1.0}, 0.7};
  MapElement elsewhere = certain;
  const Ellipse moved = T_world_level * thing;
  for (ObjectEstimate* estimate : {&elsewhere.estimate.standing, &elsewhere.estimate.moving}) {
    estimate->x.segment<2>(kPosition) = moved.center_m;
    estimate->x.segment<3>(kShape) = smooth_parameters(moved).tail<3>();
  }
  const ExpectedDetection from_there = expect_detection(elsewhere, inverse(T_world_level), free_space_of({thing}), P_D);
  EXPECT_EQ(from_there.sight, Sight::kHit);
  EXPECT_NEAR(from_there.probability, P_D, 1e-12);
}

TEST(Existence, AMissedDetectionInFreeSpaceIsBayesRule) {
  const ObjectMapParams params;
  ExpectedDetection expected;
  expected.probability = 0.5;
  const auto after = [&](Sight sight, bool another_there) {
    MapElement element = element_at({3.0, 0.0}, 0.01);
    element.log_odds = log_odds(0.6);
    expected.sight = sight;
    missed_detection_update(element, expected, another_there, params);
    return probability(element.log_odds);
  };
  const auto bayes = [](double p, double p_miss) { return p * p_miss / (p * p_miss + 1.0 - p); };
  EXPECT_NEAR(after(Sight::kSeenThrough, false), bayes(0.6, 0.5), 1e-12);
  EXPECT_NEAR(after(Sight::kHit, true), bayes(0.6, 0.5), 1e-12);
  EXPECT_NEAR(after(Sight::kHit, false), bayes(0.6, 0.95), 1e-12);  // a tenth of it
  EXPECT_NEAR(after(Sight::kHidden, false), 0.6, 1e-12);
}

TEST(Existence, AConfirmedElementThatCanMoveIsKept) {
  const ObjectMapParams params;
  ExpectedDetection expected;
  expected.sight = Sight::kSeenThrough;
  expected.probability = 0.6;
  const auto reason_after_misses = [&](TrackState state, bool mobile) {
    MapElement element = element_at({3.0, 0.0}, 0.01);
    element.state = state;
    element.mobile = mobile;
    element.log_odds = 3.0;
    for (int i = 0; i < 50; ++i) missed_detection_update(element, expected, false, params);
    EXPECT_FALSE(is_on_map(element, params));
    return std::string(deletion_reason(element, nanoseconds(0.9), params));
  };
  EXPECT_EQ(reason_after_misses(TrackState::kLost, true), "");
  EXPECT_EQ(reason_after_misses(TrackState::kLost, false), "seen through");
  EXPECT_EQ(reason_after_misses(TrackState::kTentative, true), "seen through");
}

TEST(Existence, NamesTheReasonOfADeletion) {
  ObjectMapParams params;
  params.max_unseen_s = 60.0;
  params.lost_position_sigma_m = 10.0;
  MapElement element = element_at({3.0, 0.0}, 0.01);
  element.log_odds = 3.0;
  const auto reason = [&](double time_s) { return std::string(deletion_reason(element, nanoseconds(time_s), params)); };
  EXPECT_EQ(reason(1.0), "");
  EXPECT_EQ(reason(1.05), "not confirmed");
  element.state = TrackState::kLost;
  EXPECT_EQ(reason(59.9), "");
  EXPECT_EQ(reason(60.1), "unseen for too long");
  element = element_at({3.0, 0.0}, 10.1);
  element.log_odds = 3.0;
  EXPECT_EQ(reason(0.5), "position too uncertain");
  EXPECT_EQ(reason(0.0), "") << "it was just detected";
  element.state = TrackState::kDeleted;
  EXPECT_EQ(reason(0.0), "re-identified as another");
}

TEST(Existence, OnTheMapAreConfirmedLikelyCertainElementsThatAreNoParts) {
  ObjectMapParams params;
  params.max_position_sigma_m = 0.24;
  params.correlated_error_fraction = 0.0;
  MapElement good = element_at({3.0, 0.0}, 0.2);
  good.log_odds = 1.0;
  good.state = TrackState::kConfirmed;
  EXPECT_TRUE(is_on_map(good, params));
  MapElement element = good;
  element.state = TrackState::kLost;
  EXPECT_TRUE(is_on_map(element, params)) << "it coasts";
  element.state = TrackState::kTentative;
  EXPECT_FALSE(is_on_map(element, params));
  element = good;
  element.log_odds = 0.0;
  EXPECT_FALSE(is_on_map(element, params));
  element = good;
  element.is_part = true;
  EXPECT_FALSE(is_on_map(element, params));
  MapElement uncertain = element_at({3.0, 0.0}, 0.25);
  uncertain.log_odds = 1.0;
  uncertain.state = TrackState::kConfirmed;
  EXPECT_TRUE(is_on_map(uncertain, params)) << "it is seen";
  uncertain.state = TrackState::kLost;
  EXPECT_FALSE(is_on_map(uncertain, params));
  // Correlated errors count, too: 0.2^2 + 0.4 * 0.3^2 > 0.24^2.
  params.correlated_error_fraction = 0.4;
  good.P_view = 0.3 * 0.3 * Matrix8d::Identity();
  good.state = TrackState::kLost;
  EXPECT_FALSE(is_on_map(good, params));
}

// With an ambiguous motion the position has the spread of both estimates.
TEST(Existence, AnAmbiguousMotionMakesThePositionUncertain) {
  ObjectMapParams params;
  params.correlated_error_fraction = 0.0;
  MapElement element = element_at({3.0, 0.0}, 0.1);
  element.estimate.moving.x(kPosition) += 1.0;
  const auto sigma_m = [&](double p_moving) {
    element.estimate.p_moving = p_moving;
    return published_position_sigma_m(element, params);
  };
  EXPECT_NEAR(sigma_m(0.05), 0.1, 1e-12);
  EXPECT_NEAR(sigma_m(0.95), 0.1, 1e-12);
  EXPECT_NEAR(sigma_m(0.5), std::sqrt(0.01 + 0.25), 1e-12);
}

}  // namespace
}  // namespace situation_awareness::existence_test
