// SPDX-License-Identifier: BSD-3-Clause
// Cars from scan to map: boxes that are larger than what the networks were trained for, and of which an end is hidden.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/pipeline/arrivals.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::car_tracks_test {
namespace {

constexpr double kPeriod_s = 0.1;
constexpr double kHalfLength_m = 2.1, kHalfWidth_m = 0.9;

/// As in cfg/map_outdoor.yaml.
ObjectPipelineParams outdoor_params() {
  ObjectPipelineParams params;
  params.detections.model_folder = SITUATION_AWARENESS_SOURCE_DIR "/models";
  params.segments.max_gap_m = 0.5;
  params.segments.max_range_gap_m = 0.5;
  params.segments.max_object_extent_m = 5.5;
  params.detections.fit.max_radius_m = 3.5;
  return params;
}

Box car_at(const Eigen::Vector2d& center_m, double psi_rad) { return {center_m, psi_rad, kHalfLength_m, kHalfWidth_m}; }

/// A yard without an end, seen by a scanner that looks along +y.
class Yard {
 public:
  explicit Yard(std::uint64_t seed) : random_(seed) {}

  const ObjectPipelineResult& see(const Eigen::Vector2d& lidar_world_m, const std::vector<Box>& boxes_world) {
    const Pose2 T_world_lidar{lidar_world_m, 0.5 * kPi};
    const Pose2 T_lidar_world = inverse(T_world_lidar);
    LevelScene scene;
    scene.max_range_m = 20.0;
    for (const Box& box : boxes_world) {
      const std::array<Eigen::Vector2d, 4> at = corners(T_lidar_world * box);
      for (std::size_t i = 0; i < at.size(); ++i) scene.walls.push_back({at[i], at[(i + 1) % at.size()]});
    }
    Scan scan = scene.scan(&random_);
    scan.stamp_ns = nanoseconds(kPeriod_s * scans_++);
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation().head<2>() = T_world_lidar.translation_m;
    T.rotate(Eigen::AngleAxisd(T_world_lidar.yaw_rad, Eigen::Vector3d::UnitZ()));
    return pipeline_.process(scan, T);
  }

 private:
  ObjectPipeline pipeline_{outdoor_params()};
  Random random_;
  int scans_ = 0;
};

/// The object on the map that is nearest to a place, if it is within a metre; else null.
const Object* object_at(const Objects& objects, const Eigen::Vector2d& center_m) {
  const Object* nearest = nullptr;
  double least_m = 1.0;
  for (const Object& object : objects.objects) {
    const double away_m = (object.ellipse_world.center_m - center_m).norm();
    if (away_m >= least_m) continue;
    least_m = away_m;
    nearest = &object;
  }
  return nearest;
}

// The shape network gives a car of which two sides are seen 0.3 to 0.9 m of error, and too small a box goes on from
// there.
TEST(CarTracks, ACarOfWhichTwoSidesAreSeenIsAsLargeAsItIs) {
  for (const double psi_rad : {0.3, 0.8, 2.0, 2.3}) {
    Yard yard(1);
    const Box car = car_at({3.0, 9.0}, psi_rad);
    const ObjectPipelineResult* result = nullptr;
    for (int i = 0; i < 5; ++i) result = &yard.see({0.0, 0.0}, {car});
    const Object* const object = object_at(result->objects, car.center_m);
    ASSERT_NE(object, nullptr) << psi_rad;
    EXPECT_EQ(object->shape, Shape::kBox);
    EXPECT_LT((object->box_world.center_m - car.center_m).norm(), 0.1) << psi_rad;
    EXPECT_NEAR(object->box_world.half_length_m, kHalfLength_m, 0.08) << psi_rad;
    EXPECT_NEAR(object->box_world.half_width_m, kHalfWidth_m, 0.08) << psi_rad;
    EXPECT_LT(std::abs(std::remainder(object->box_world.psi_rad - psi_rad, kPi)), 0.05) << psi_rad;
  }
}

/// Three cars side by side that are seen from before and aside; the middle one drives out after `begin_s`.
struct Row {
  static constexpr double kSpeed_m_s = 1.5, kBegin_s = 3.0;

  std::vector<Box> at(double time_s) const {
    const double out_m = kSpeed_m_s * std::max(0.0, time_s - kBegin_s);
    std::vector<Box> cars;
    for (const double x_m : {-2.7, 0.0, 2.7}) {
      cars.push_back(car_at({x_m, 12.0 - (x_m == 0.0 ? out_m : 0.0)}, 0.5 * kPi));
    }
    return cars;
  }
};

TEST(CarTracks, ACarThatDrivesOutFromBetweenOthersMovesAndTheOthersDoNot) {
  Yard yard(3);
  const Row row;
  double known_s = -1.0;
  for (int i = 0; i < 70; ++i) {
    const double time_s = kPeriod_s * i;
    const std::vector<Box> cars = row.at(time_s);
    const Objects& objects = yard.see({5.0, 2.0}, cars).objects;
    for (const std::size_t parked : {0U, 2U}) {
      const Object* const object = object_at(objects, cars[parked].center_m);
      EXPECT_TRUE(object == nullptr || object->p_moving < 0.5) << time_s;
    }
    if (time_s < Row::kBegin_s) continue;
    const auto moving = std::find_if(objects.objects.begin(), objects.objects.end(), [&](const Object& object) {
      return object.p_moving > 0.5 && offset_m(cars[1], object.box_world.center_m) < 0.0;
    });
    if (moving == objects.objects.end()) continue;
    if (known_s < 0.0) known_s = time_s - Row::kBegin_s;
    if (time_s < Row::kBegin_s + 2.0) continue;
    EXPECT_LT((moving->velocity_world_m_s - Eigen::Vector2d(0.0, -Row::kSpeed_m_s)).norm(), 0.5) << time_s;
  }
  EXPECT_GE(known_s, 0.0);
  EXPECT_LT(known_s, 1.5);
}

// From behind a van that stands in front of it more and more of a car comes into view as the robot goes by.
TEST(CarTracks, MoreOfAStandingCarThatComesIntoViewIsNoMotion) {
  Yard yard(4);
  const Box van = car_at({-1.5, 5.0}, 0.0), car = car_at({0.0, 10.0}, 0.0);
  for (int i = 0; i < 60; ++i) {
    const Objects& objects = yard.see({-1.0 + 0.12 * i, 0.0}, {van, car}).objects;
    for (const Object& object : objects.objects) {
      EXPECT_LT(object.p_moving, 0.5) << i << ": at " << object.ellipse_world.center_m.transpose();
    }
  }
}

/// A segment of hits side by side along x, seen from the origin, whose left end is hidden.
Segments face(double stamp_s, double from_x_m, double to_x_m, double y_m, double background_m) {
  Segments segments;
  segments.stamp_ns = nanoseconds(stamp_s);
  Segment& segment = segments.segments.emplace_back();
  segment.left_end = SegmentEnd::kOccluded;
  constexpr int kBeams = 361;
  for (int i = 0; i < kBeams; ++i) {
    const double azimuth_rad = kPi * i / (kBeams - 1);
    const double x_m = y_m / std::tan(azimuth_rad);
    const bool is_hit = azimuth_rad > 0.01 && x_m >= from_x_m && x_m <= to_x_m;
    const double range_m = is_hit ? std::hypot(x_m, y_m) : background_m;
    segments.free_space.azimuth_rad.push_back(static_cast<float>(azimuth_rad));
    segments.free_space.range_m.push_back(static_cast<float>(range_m));
    if (!is_hit) continue;
    Point& hit = segments.points.emplace_back();
    hit.p_level_m = {x_m, y_m};
    ++segment.count;
  }
  return segments;
}

bool has_arrived(const Segments& segments, Arrivals& arrivals, bool hidden_end = true) {
  Detections detections;
  detections.detections.resize(1);
  detections.detections[0].hidden_end = hidden_end;
  return arrivals.mark(segments, detections).detections[0].has_arrived;
}

TEST(Arrivals, WhatIsWhereItWasFreeHasArrivedAndWhatGrowsHasNot) {
  Arrivals arrivals;
  EXPECT_FALSE(has_arrived(face(0.0, -2.0, 0.0, 5.0, 20.0), arrivals)) << "nothing is known of before";
  EXPECT_FALSE(has_arrived(face(0.6, -2.0, 0.1, 5.0, 20.0), arrivals)) << "it stands";
  EXPECT_TRUE(has_arrived(face(1.2, -0.5, 1.5, 5.0, 20.0), arrivals)) << "three quarters of it are where it was free";
  EXPECT_FALSE(has_arrived(face(1.8, -0.5, 1.5, 5.0, 20.0), arrivals, false)) << "no end is hidden";
  Arrivals others;
  // What hides the right part stands nearer.
  EXPECT_FALSE(has_arrived(face(0.0, -2.0, 0.0, 5.0, 4.0), others));
  EXPECT_FALSE(has_arrived(face(0.6, -2.0, 3.0, 5.0, 4.0), others)) << "more of it is in view";
}

TEST(Arrivals, BeginAnewWhereTimeGoesBack) {
  Arrivals arrivals;
  has_arrived(face(100.0, -2.0, 0.0, 5.0, 20.0), arrivals);
  EXPECT_FALSE(has_arrived(face(10.0, 1.0, 3.0, 5.0, 20.0), arrivals)) << "it is not known what was there before";
  EXPECT_TRUE(has_arrived(face(10.6, 4.0, 6.0, 5.0, 20.0), arrivals));
  EXPECT_FALSE(has_arrived(face(30.0, 1.0, 3.0, 5.0, 20.0), arrivals)) << "that is long ago";
}

}  // namespace
}  // namespace situation_awareness::car_tracks_test
