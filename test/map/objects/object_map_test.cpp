// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/object_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <set>

#include <Eigen/Eigenvalues>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

using namespace object_error;

constexpr double kScanPeriodS = 0.05;

Detection detection_of(const Ellipse& ellipse_level) {
  Detection detection;
  detection.ellipse_level = canonical(ellipse_level);
  detection.covariance = 4e-4 * Matrix5d::Identity();
  detection.beams = 20;
  return detection;
}

Detections detections_at(double time_s, const std::vector<Ellipse>& ellipses_world, const Pose2& T_world_level = {}) {
  Detections detections;
  detections.stamp_ns = nanoseconds(time_s);
  detections.T_world_level = T_world_level;
  for (const Ellipse& ellipse : ellipses_world) {
    detections.detections.push_back(detection_of(inverse(T_world_level) * ellipse));
  }
  return detections;
}

Ellipse moving(double time_s) { return {{3.0 + 0.8 * time_s, 1.0 - 0.4 * time_s}, 0.3, 0.3, 0.15}; }

TEST(ObjectMap, IsOnTheMapAfterItsThirdObservation) {
  ObjectMap map{ObjectMapParams{}};
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(map.at(map.stamp_ns()).objects.empty());
    map.update(detections_at(i * kScanPeriodS, {{{3.0, 0.0}, 0.0, 0.3, 0.2}}));
  }
  const Objects objects = map.at(map.stamp_ns());
  ASSERT_EQ(objects.objects.size(), 1U);
  EXPECT_EQ(objects.objects[0].id, 1U);
  EXPECT_EQ(objects.objects[0].observations, 3);
  EXPECT_EQ(objects.objects[0].beams, 20);
  EXPECT_EQ(objects.objects[0].first_seen_ns, 0);
  EXPECT_EQ(objects.objects[0].last_seen_ns, nanoseconds(2 * kScanPeriodS));
}

TEST(ObjectMap, ObservationsWithAHiddenEndTakeLongerToConvince) {
  ObjectMap map{ObjectMapParams{}};
  int scans = 0;
  while (map.at(map.stamp_ns()).objects.empty() && scans < 100) {
    Detections detections = detections_at(scans++ * kScanPeriodS, {{{3.0, 0.0}, 0.0, 0.3, 0.2}});
    detections.detections[0].hidden_end = true;
    map.update(detections);
  }
  EXPECT_EQ(scans, 12);  // 3 / 0.25
}

TEST(ObjectMap, ANewElementIsAsUncertainAsItsDetectionAndMoreSoWithAHiddenEnd) {
  ObjectMapParams params;
  params.robot_position_sigma_m = params.robot_yaw_sigma_rad = params.measurement_sigma_m = 0.0;
  params.min_observations = params.hidden_observation_weight = 1.0;
  params.hidden_end_factor = 3.0;
  const auto covariance_of = [&](bool hidden_end) {
    ObjectMap map(params);
    Detections detections = detections_at(0.0, {{{3.0, 0.0}, 0.4, 0.3, 0.1}});
    detections.detections[0].hidden_end = hidden_end;
    map.update(detections);
    const Matrix8d P = map.at(0).objects.at(0).covariance;
    Matrix5d covariance = Matrix5d::Zero();  // of position, orientation and radii
    const int places[] = {kPosition, kPosition + 1, kOrientation, kRadii, kRadii + 1};
    for (int r = 0; r < 5; ++r) {
      for (int c = 0; c < 5; ++c) covariance(r, c) = P(places[r], places[c]);
    }
    return covariance;
  };
  const Ellipse ellipse{{3.0, 0.0}, 0.4, 0.3, 0.1};
  const Matrix5d R = ellipse_covariance(ellipse, detection_of(ellipse).covariance);
  EXPECT_LT((covariance_of(false) - R).norm(), 1e-9);
  EXPECT_LT((covariance_of(true) - 9.0 * R).norm(), 1e-9);
}

TEST(ObjectMap, FollowsAMovingObjectAndPredictsItOnDemand) {
  ObjectMap map{ObjectMapParams{}};
  double time_s = 0.0;
  for (int i = 0; i < 60; ++i) {
    time_s = i * kScanPeriodS;
    map.update(detections_at(time_s, {moving(time_s)}));
  }
  const Objects now = map.at(map.stamp_ns());
  ASSERT_EQ(now.objects.size(), 1U);
  EXPECT_LT((now.objects[0].velocity_world_m_s - Eigen::Vector2d(0.8, -0.4)).norm(), 0.05);
  const Objects later = map.at(nanoseconds(time_s + 0.5));
  EXPECT_LT((later.objects[0].ellipse_world.center_m - moving(time_s + 0.5).center_m).norm(), 0.05);
  EXPECT_GT(later.objects[0].covariance.trace(), now.objects[0].covariance.trace());
  // Asking changes nothing.
  EXPECT_EQ(map.at(map.stamp_ns()).objects[0].covariance, now.objects[0].covariance);
}

TEST(ObjectMap, TheRobotsMotionDoesNotMoveAStandingObject) {
  ObjectMap map{ObjectMapParams{}};
  const Ellipse standing{{3.0, 0.5}, 0.4, 0.3, 0.2};
  for (int i = 0; i < 100; ++i) {
    const double time_s = i * kScanPeriodS;
    map.update(detections_at(time_s, {standing}, {{0.3 * time_s, -0.2 * time_s}, 0.5 * time_s}));
  }
  const Objects objects = map.at(map.stamp_ns());
  ASSERT_EQ(objects.objects.size(), 1U);
  EXPECT_LT(symmetric_characteristic_distance(objects.objects[0].ellipse_world, standing), 0.01);
  EXPECT_LT(objects.objects[0].velocity_world_m_s.norm(), 0.02);
  EXPECT_LT(std::abs(objects.objects[0].angular_velocity_rad_s), 0.02);
}

TEST(ObjectMap, TwoObjectsThatCrossKeepTheirIdentities) {
  ObjectMap map{ObjectMapParams{}};
  const auto a = [](double t) { return Ellipse{{3.0, -2.0 + 1.0 * t}, 0.0, 0.2, 0.2}; };
  const auto b = [](double t) { return Ellipse{{3.6, 2.0 - 1.0 * t}, 0.0, 0.2, 0.2}; };
  for (int i = 0; i <= 80; ++i) {
    const double time_s = i * kScanPeriodS;
    // The order of detections must not matter.
    map.update(i % 2 == 0 ? detections_at(time_s, {a(time_s), b(time_s)})
                          : detections_at(time_s, {b(time_s), a(time_s)}));
  }
  const Objects objects = map.at(map.stamp_ns());
  ASSERT_EQ(objects.objects.size(), 2U);
  EXPECT_EQ(objects.objects[0].id, 1U);
  EXPECT_LT((objects.objects[0].ellipse_world.center_m - a(4.0).center_m).norm(), 0.05);
  EXPECT_EQ(objects.objects[1].id, 2U);
  EXPECT_LT((objects.objects[1].ellipse_world.center_m - b(4.0).center_m).norm(), 0.05);
}

TEST(ObjectMap, OneDetectionUpdatesOneElement) {
  ObjectMap map{ObjectMapParams{}};
  const std::vector<Ellipse> two{{{3.0, 0.0}, 0.0, 0.1, 0.1}, {{3.0, 0.3}, 0.0, 0.1, 0.1}};
  for (int i = 0; i < 5; ++i) map.update(detections_at(i * kScanPeriodS, two));
  const ObjectMapUpdate update = map.update(detections_at(5 * kScanPeriodS, {two[0]}));
  EXPECT_EQ(update.updated, (std::vector<std::uint64_t>{1}));
}

TEST(ObjectMap, AnElementThatIsNoLongerSeenIsDeletedWhenItsPositionIsUncertain) {
  ObjectMapParams params;
  ObjectMap map(params);
  for (int i = 0; i < 40; ++i) map.update(detections_at(i * kScanPeriodS, {{{3.0, 0.0}, 0.0, 0.3, 0.2}}));
  ASSERT_EQ(map.at(map.stamp_ns()).objects.size(), 1U);
  int i = 40;
  double sigma_m = 0.0;
  ObjectMapUpdate update;
  while (map.at(map.stamp_ns()).objects.size() == 1U && i < 1000) {
    sigma_m = std::sqrt(map.at(map.stamp_ns()).objects[0].covariance(kPosition, kPosition));
    EXPECT_LE(sigma_m, params.max_position_sigma_m);
    update = map.update(detections_at(i++ * kScanPeriodS, {}));
  }
  EXPECT_LT(i, 200);
  EXPECT_GT(sigma_m, 0.8 * params.max_position_sigma_m);
  EXPECT_EQ(update.deleted, (std::vector<std::uint64_t>{1}));
  EXPECT_EQ(update.reasons, (Counters{{"position too uncertain", 1}}));
}

TEST(ObjectMap, ASecondPieceOfAnElementAlreadySeenIsNotANewOne) {
  ObjectMap map{ObjectMapParams{}};
  const Ellipse body{{3.0, 0.0}, 0.0, 0.3, 0.3};
  for (int i = 0; i < 10; ++i) map.update(detections_at(i * kScanPeriodS, {body}));
  const ObjectMapUpdate update = map.update(detections_at(10 * kScanPeriodS, {body, {{2.85, 0.1}, 0.0, 0.05, 0.05}}));
  EXPECT_TRUE(update.created.empty());
  EXPECT_EQ(update.reasons, (Counters{{"detection on an element already seen", 1}}));
}

TEST(ObjectMap, TimeThatRepeatsOrGoesBackIsDroppedAndAJumpBackStartsANewMap) {
  ObjectMap map{ObjectMapParams{}};
  const Ellipse standing{{3.0, 0.0}, 0.0, 0.3, 0.2};
  for (int i = 0; i < 10; ++i) map.update(detections_at(100.0 + i * kScanPeriodS, {standing}));
  const Objects before = map.at(map.stamp_ns());
  EXPECT_EQ(map.update(detections_at(100.0 + 9 * kScanPeriodS, {standing})).reasons, (Counters{{"stamp repeats", 1}}));
  EXPECT_EQ(map.update(detections_at(100.0, {standing})).reasons, (Counters{{"stamp goes back", 1}}));
  const Objects after = map.at(map.stamp_ns());
  ASSERT_EQ(after.objects.size(), 1U);
  EXPECT_EQ(after.objects[0].covariance, before.objects[0].covariance);
  EXPECT_EQ(after.objects[0].observations, before.objects[0].observations);

  const ObjectMapUpdate update = map.update(detections_at(5.0, {standing}));
  EXPECT_EQ(update.reasons, (Counters{{"time jumped back: new map", 1}}));
  EXPECT_EQ(update.deleted, (std::vector<std::uint64_t>{1}));
  EXPECT_EQ(update.created, (std::vector<std::uint64_t>{2}));  // identities are never used twice
}

TEST(ObjectMap, IsTheSameWhereverTheWorldsOriginIs) {
  const Pose2 T_other_world{{40.0, -25.0}, 2.0};
  ObjectMap map{ObjectMapParams{}};
  ObjectMap other_map{ObjectMapParams{}};
  Random random(3);
  for (int i = 0; i < 50; ++i) {
    const double time_s = i * kScanPeriodS;
    Ellipse seen = moving(time_s);
    seen.center_m += 0.02 * Eigen::Vector2d(random.normal(), random.normal());
    const Pose2 T_world_level{{0.1 * time_s, 0.2}, 0.3 * time_s};
    const Detections detections = detections_at(time_s, {seen}, T_world_level);
    Detections other = detections;
    other.T_world_level = T_other_world * T_world_level;
    map.update(detections);
    other_map.update(other);
  }
  const Objects a = map.at(map.stamp_ns());
  const Objects b = other_map.at(map.stamp_ns());
  ASSERT_EQ(a.objects.size(), 1U);
  ASSERT_EQ(b.objects.size(), 1U);
  EXPECT_LT(symmetric_characteristic_distance(T_other_world * a.objects[0].ellipse_world, b.objects[0].ellipse_world),
            1e-9);
  EXPECT_LT((T_other_world.rotation() * a.objects[0].velocity_world_m_s - b.objects[0].velocity_world_m_s).norm(),
            1e-9);
}

TEST(ObjectMap, ACircleKeepsABoundedPositiveDefiniteCovariance) {
  ObjectMap map{ObjectMapParams{}};
  Random random(4);
  for (int i = 0; i < 5000; ++i) {
    map.update(detections_at(i * kScanPeriodS, {{{3.0, 0.0}, random.uniform(-1.5, 1.5), 0.2, 0.2}}));
  }
  const Objects objects = map.at(map.stamp_ns());
  ASSERT_EQ(objects.objects.size(), 1U);
  const Matrix8d P = objects.objects[0].covariance;
  EXPECT_LE(std::sqrt(P(kOrientation, kOrientation)), kPi / std::sqrt(12.0) + 1e-9);
  EXPECT_LE(std::sqrt(P(kAngularVelocity, kAngularVelocity)),
            ObjectMapParams{}.initial_angular_velocity_sigma_rad_s + 1e-9);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix8d>(P).eigenvalues().minCoeff(), 0.0);
  EXPECT_GE(objects.objects[0].ellipse_world.rx_m, objects.objects[0].ellipse_world.ry_m);
}

TEST(ObjectMap, SameInputGivesTheSameMapBitForBit) {
  const auto run = [] {
    ObjectMap map{ObjectMapParams{}};
    Random random(5);
    for (int i = 0; i < 50; ++i) {
      std::vector<Ellipse> seen;
      for (int k = 0; k < 8; ++k) {
        seen.push_back({{3.0 + k + 0.01 * random.normal(), 0.5 * k + 0.01 * random.normal()}, 0.0, 0.3, 0.2});
      }
      map.update(detections_at(i * kScanPeriodS, seen));
    }
    return map.at(map.stamp_ns());
  };
  const Objects a = run();
  const Objects b = run();
  ASSERT_EQ(a.objects.size(), 8U);
  ASSERT_EQ(b.objects.size(), 8U);
  for (std::size_t i = 0; i < a.objects.size(); ++i) {
    EXPECT_EQ(a.objects[i].ellipse_world.center_m, b.objects[i].ellipse_world.center_m);
    EXPECT_EQ(a.objects[i].covariance, b.objects[i].covariance);
  }
}

TEST(ObjectMapParams, RefusesWrongValuesByName) {
  ObjectMapParams params;
  params.gate_probability = 1.0;
  try {
    ObjectMap map(params);
    FAIL() << "accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("objects.gate_probability"), std::string::npos);
  }
}

}  // namespace
}  // namespace situation_awareness
