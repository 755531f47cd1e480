// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <limits>
#include <variant>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/map/map.hpp"
#include "situation_awareness/path/path.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// A vehicle on a path among boxes, for tests: an exact scan from its base, 270 deg, 0.5 deg.
struct SafetyScene {
  Path path;
  Pose2 T_world_base;
  std::int64_t stamp_ns = 100'000'000'000;
  std::vector<Box> boxes;
  std::vector<Box> far_off = {{{3.0, 14.0}, 0.0, 9.0, 0.1}};  ///< what shows that the scanner sees, beyond all areas
  std::vector<Eigen::Vector2d> lone_hits;                     ///< each on the beam that is next to it
  Map map;                                                    ///< as fresh as the scan

  SafetyScene() { map.stamp_ns = map.objects_stamp_ns = stamp_ns; }

  static SafetyScene straight() {
    SafetyScene scene;
    scene.path.way_points = {{{-2.0, 0.0}, {}}, {{12.0, 0.0}, {}}};
    return scene;
  }

  /// Puts the outline of a box on the map, for 10 s.
  Feature& know(const Box& box, FeatureId id, Motion motion = Motion::kFixed) {
    PolylineShape outline;
    outline.closed = true;
    for (const Eigen::Vector2d& corner : corners(box)) outline.vertices.push_back({corner, 0.003});
    return add(id, outline, motion);
  }

  /// Puts something on the map, for 10 s.
  Feature& add(FeatureId id, const FeatureShape& shape, Motion motion = Motion::kStanding) {
    Feature& feature = map.features.emplace_back();
    feature.id = id;
    feature.p_exists = 0.99;
    feature.motion = motion;
    feature.first_seen_ns = stamp_ns - 10'000'000'000;
    feature.last_seen_ns = stamp_ns;
    feature.seen_by.scan = true;
    feature.shape = shape;
    return feature;
  }

  /// Later, with a map that sees all that it saw.
  void advance(std::int64_t period_ns) {
    stamp_ns += period_ns;
    map.stamp_ns = map.objects_stamp_ns = stamp_ns;
    for (Feature& feature : map.features) feature.last_seen_ns = stamp_ns;
  }

  SafetyScene moved(const Pose2& T) const {
    SafetyScene result = *this;
    for (WayPoint& point : result.path.way_points) point.p_world_m = T * point.p_world_m;
    result.T_world_base = T * T_world_base;
    for (Box& box : result.boxes) box = T * box;
    for (Box& box : result.far_off) box = T * box;
    for (Eigen::Vector2d& hit : result.lone_hits) hit = T * hit;
    for (Feature& feature : result.map.features) move(feature, T, 0.0);
    return result;
  }

  Points points() const {
    Points result;
    result.stamp_ns = stamp_ns;
    result.T_world_level = T_world_base;
    result.resolution_rad = radians(0.5);
    for (int i = 0; i < 541; ++i) {
      Point point;
      point.beam = i;
      point.azimuth_rad = radians(-135.0 + 0.5 * i);
      const Eigen::Vector2d u(std::cos(point.azimuth_rad), std::sin(point.azimuth_rad));
      double range_m = std::numeric_limits<double>::infinity();
      for (const auto* things : {&boxes, &far_off}) {
        for (const Box& box : *things)
          range_m = std::min(range_m, cast(box, Eigen::Rotation2Dd(T_world_base.yaw_rad) * u));
      }
      for (const Eigen::Vector2d& hit : lone_hits) {
        const Eigen::Vector2d p = inverse(T_world_base) * hit;
        if (std::abs(std::atan2(p.y(), p.x()) - point.azimuth_rad) < radians(0.25))
          range_m = std::min(range_m, p.norm());
      }
      point.state = range_m < 20.0 ? BeamState::kHit : BeamState::kFree;
      point.range_m = std::min(range_m, 20.0);
      if (point.state == BeamState::kHit) point.p_level_m = range_m * u;
      result.points.push_back(point);
    }
    return result;
  }

 private:
  double cast(const Box& box, const Eigen::Vector2d& u) const {
    const auto c = corners(box);
    double range_m = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d d = c[(i + 1) % 4] - c[i], f = c[i] - T_world_base.translation_m;
      const double determinant = d.x() * u.y() - d.y() * u.x();
      if (std::abs(determinant) < 1e-12) continue;
      const double r = (f.y() * d.x() - f.x() * d.y()) / determinant;
      const double s = (u.x() * f.y() - u.y() * f.x()) / determinant;
      if (r > 0.0 && s >= 0.0 && s <= 1.0) range_m = std::min(range_m, r);
    }
    return range_m;
  }
};

}  // namespace situation_awareness
