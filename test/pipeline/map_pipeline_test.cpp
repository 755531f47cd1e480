// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/map_pipeline.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/saved_map.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness::map_pipeline_test {
namespace {

constexpr double kTower_m = 6.0, kDistance_m = 14.0;
/// A wall along y, beside the way.
constexpr double kWall_m = 20.0, kHalfWall_m = 2.0;
constexpr std::int64_t kPeriod_ns = 100'000'000, kBegin_ns = 1'000'000'000'000;
/// Scans of a round at 5 m/s.
const int kRound = static_cast<int>(2.0 * kPi * kDistance_m / 0.5) + 1;
const Eigen::Matrix3d kCovariance = Eigen::Vector3d(1e-4, 1e-4, 1e-6).asDiagonal();

MapPipelineParams coarse() {
  MapPipelineParams params;
  params.layers.polylines.max_offset_m = 0.1;
  params.layers.polygons.spacing_m = 0.15;
  params.layers.polygons.gate_m = 0.3;
  params.layers.polygons.max_gap_m = 1.0;
  params.layers.polygons.pass_margin_m = 0.2;
  params.layers.polygons.max_pose_sigma_m = 10.0;
  return params;
}

Eigen::Isometry3d pose_at(int i) {
  const double angle_rad = 0.5 * i / kDistance_m;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << kDistance_m * std::cos(angle_rad), kDistance_m * std::sin(angle_rad), 10.0;
  T.linear() = Eigen::AngleAxisd(angle_rad + 0.5 * kPi, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return T;
}

double range_to_tower(const Eigen::Vector2d& from_m, const Eigen::Vector2d& u) {
  const double along_m = -from_m.dot(u), aside_2 = from_m.squaredNorm() - along_m * along_m;
  if (along_m <= 0.0 || aside_2 >= kTower_m * kTower_m) return INFINITY;
  return along_m - std::sqrt(kTower_m * kTower_m - aside_2);
}

double range_to_wall(const Eigen::Vector2d& from_m, const Eigen::Vector2d& u) {
  const double along_m = (kWall_m - from_m.x()) / u.x();
  return along_m > 0.0 && std::abs(from_m.y() + along_m * u.y()) < kHalfWall_m ? along_m : INFINITY;
}

/// The scan of a vehicle that flies around a tower, and past a wall while that is there.
Scan scan_at(int i, std::int64_t stamp_ns, bool with_wall) {
  constexpr int kBeams = 721;
  const Eigen::Isometry3d T = pose_at(i);
  const Eigen::Vector2d p_m = T.translation().head<2>();
  Scan scan;
  scan.stamp_ns = stamp_ns;
  scan.angle_min_rad = -kPi;
  scan.angle_increment_rad = 2.0 * kPi / (kBeams - 1);
  for (int k = 0; k < kBeams; ++k) {
    const double angle_rad = scan.angle_min_rad + k * scan.angle_increment_rad;
    const Eigen::Vector2d u = (T.linear() * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0.0)).head<2>();
    double range_m = range_to_tower(p_m, u);
    if (with_wall) range_m = std::min(range_m, range_to_wall(p_m, u));
    scan.beams.push_back(beam_from_range(static_cast<float>(range_m), 0.1F, 30.0F));
  }
  return scan;
}

/// Flies on, and collects what is told to be gone.
std::vector<Gone> fly(MapPipeline& map, int from, int scans, std::int64_t begin_ns = kBegin_ns, bool with_wall = true) {
  std::vector<Gone> gone;
  for (int i = from; i < from + scans; ++i) {
    const MapDelta& delta =
        map.process(scan_at(i, begin_ns + i * kPeriod_ns, with_wall), pose_at(i), pose_at(i), kCovariance);
    gone.insert(gone.end(), delta.gone.begin(), delta.gone.end());
  }
  return gone;
}

/// "kind" of each feature, by id.
std::vector<std::pair<FeatureId, std::string>> kinds_of(const Map& map) {
  std::vector<std::pair<FeatureId, std::string>> kinds;
  for (const Feature& feature : map.features) kinds.emplace_back(feature.id, kind_of(feature.shape));
  return kinds;
}

/// The distance of the points of an outline from the tower or the wall, at most.
double off_truth_m(const Feature& feature) {
  const bool is_tower = std::holds_alternative<ArcShape>(feature.shape);
  double most_m = 0.0;
  for (const Eigen::Vector2d& p_m : points_along(feature.shape)) {
    most_m = std::max(most_m, is_tower ? std::abs(p_m.norm() - kTower_m) : std::abs(p_m.x() - kWall_m));
  }
  return most_m;
}

SavedMap through_a_file(const MapPipeline& map) {
  SavedMap saved = map.saved();
  saved.world_frame = "map";
  return map_from_json(map_to_json(saved), "text", "map");
}

const MapKinds kStanding{false, true, true, false};

TEST(MapPipeline, GoesOnFromASavedMapUnderItsIds) {
  MapPipeline before(coarse(), kStanding);
  fly(before, 0, kRound + 30);
  const auto kinds = kinds_of(before.map());
  ASSERT_EQ(kinds.size(), 2U);
  const SavedMap saved = through_a_file(before);
  // In another program, whose clock may begin anew, stand still, or be ahead.
  for (const std::int64_t later_ns : {-kBegin_ns / 2, std::int64_t{0}, kBegin_ns}) {
    MapPipeline after(coarse(), kStanding);
    const MapDelta loaded = after.resume(saved);
    EXPECT_TRUE(loaded.full);
    EXPECT_EQ(kinds_of(after.map()), kinds) << "before any scan";
    EXPECT_EQ(loaded.changed.size(), 2U);
    for (const Feature& feature : after.map().features) EXPECT_LT(off_truth_m(feature), 0.06);
    EXPECT_TRUE(fly(after, 0, kRound + 30, kBegin_ns + later_ns).empty());
    EXPECT_EQ(kinds_of(after.map()), kinds) << "it is the same place";
    for (const Feature& feature : after.map().features) {
      EXPECT_LE(feature.first_seen_ns, kBegin_ns + later_ns) << "it was there before";
    }
  }
}

TEST(MapPipeline, WhatBeamsPassSinceTheMapWasSavedIsDoubtedAsIfItHadNotBeenSaved) {
  const auto p_of_wall = [](const Map& map) {
    for (const Feature& feature : map.features) {
      if (std::holds_alternative<PolylineShape>(feature.shape)) return feature.p_exists;
    }
    return 0.0;
  };
  MapPipeline same(coarse(), kStanding);
  fly(same, 0, kRound + 30);
  MapPipeline after(coarse(), kStanding);
  after.resume(through_a_file(same));
  EXPECT_NEAR(p_of_wall(after.map()), p_of_wall(same.map()), 1e-3);
  fly(same, kRound + 30, 2 * kRound, kBegin_ns, false);
  fly(after, kRound + 30, 2 * kRound, 2 * kBegin_ns, false);
  EXPECT_LT(p_of_wall(same.map()), 0.96);
  EXPECT_NEAR(p_of_wall(after.map()), p_of_wall(same.map()), 0.05);
}

TEST(MapPipeline, ASavedMapReplacesItsOwn) {
  MapPipeline map(coarse(), kStanding);
  fly(map, 0, kRound + 30);
  const SavedMap saved = through_a_file(map);
  const std::uint64_t number = map.whole().map;
  fly(map, kRound + 30, 20);
  const std::int64_t stamp_ns = map.map().stamp_ns;
  const MapDelta loaded = map.resume(saved);
  EXPECT_NE(loaded.map, number) << "it is another map";
  EXPECT_EQ(loaded.stamp_ns, stamp_ns) << "at the time of now";
  EXPECT_EQ(kinds_of(map.map()).size(), 2U);
  EXPECT_TRUE(fly(map, kRound + 50, 60).empty());
  for (const Feature& feature : map.map().features) EXPECT_LT(feature.id, saved.next_id);
  map.resume({"map", 1, {}});
  EXPECT_EQ(map.size(), 0U);
  fly(map, kRound + 110, 60);
  EXPECT_GT(map.size(), 0U);
  for (const Feature& feature : map.map().features) EXPECT_GE(feature.id, saved.next_id) << "no id is given twice";
}

TEST(MapPipeline, AllKindsOfFeaturesAreOnTheMapThatTheyAreLoadedInto) {
  SavedMap saved;
  saved.next_id = 100;
  saved.map.stamp_ns = kBegin_ns;
  const std::vector<FeatureShape> shapes{EllipseShape{{{100.0, 0.0}, 0.0, 0.3, 0.2}, {}},
                                         BoxShape{{{110.0, 0.0}, 0.3, 2.0, 0.9}, {}},
                                         PolylineShape{{{{120.0, 0.0}, 0.01}, {{125.0, 0.0}, 0.01}}, false},
                                         FootprintShape{{130.0, 0.0, 2.0}, 0.01 * Eigen::Matrix2d::Identity(), 8.0}};
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    Feature& feature = saved.map.features.emplace_back();
    feature.id = 10 + i;
    feature.first_seen_ns = feature.last_seen_ns = kBegin_ns;
    feature.motion = Motion::kStanding;
    feature.shape = shapes[i];
  }
  saved.map.features[1].object_class = ObjectClass::kVehicle;
  saved.map.features[1].p_class = 0.9;
  Feature mover = saved.map.features[0];
  mover.id = 50;
  mover.motion = Motion::kMoving;
  saved.map.features.push_back(mover);
  for (const MapKinds& kinds : {MapKinds{false, true, true, false}, MapKinds{false, true, false, false},
                                MapKinds{false, false, true, false}, MapKinds{false, false, false, true}}) {
    MapPipeline map(coarse(), kinds);
    map.resume(saved);
    EXPECT_EQ(kinds_of(map.map()), (std::vector<std::pair<FeatureId, std::string>>{
                                       {10, "ellipse"}, {11, "box"}, {12, "polyline"}, {13, "target"}}));
    EXPECT_EQ(map.map().features[1].object_class, ObjectClass::kVehicle);
    if (kinds.are_of_scans()) fly(map, 0, 40, 2 * kBegin_ns);
    const auto there = kinds_of(map.map());
    for (const FeatureId id : {10, 11, 12, 13}) {
      EXPECT_EQ(std::count_if(there.begin(), there.end(), [&](const auto& own) { return own.first == id; }), 1)
          << id << " is out of sight";
    }
  }
}

TEST(MapPipeline, AMapThatIsTooLargeIsRefusedAndChangesNothing) {
  MapPipeline map(coarse(), kStanding);
  fly(map, 0, 60);
  const auto kinds = kinds_of(map.map());
  SavedMap saved;
  Feature& feature = saved.map.features.emplace_back();
  feature.id = 1;
  feature.shape = ArcShape{
      {{{0.0, 0.0}, 900.0, 0.01, false}, {{1e3, 1.0}, 900.0, 0.01, false}, {{2e3, 0.0}, 0.0, 0.01, false}}, false};
  EXPECT_THROW(map.resume(saved), std::invalid_argument);
  feature.shape = PolylineShape{{{{-9e5, 0.0}, 0.01}, {{9e5, 0.0}, 0.01}}, false};
  EXPECT_THROW(map.resume(saved), std::invalid_argument);
  EXPECT_EQ(kinds_of(map.map()), kinds);
}

}  // namespace
}  // namespace situation_awareness::map_pipeline_test
