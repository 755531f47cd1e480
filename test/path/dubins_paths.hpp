// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/path/dubins.hpp"

namespace situation_awareness {

inline double distance(const Pose2& a, const Pose2& b) {
  return std::max((a.translation_m - b.translation_m).norm(), std::abs(wrap_to_pi(a.yaw_rad - b.yaw_rad)));
}

inline Pose2 pose_of(const DubinsEnd& end) { return {end.p_m, end.yaw_rad.value()}; }

inline DubinsEnd moved(const Pose2& T, const DubinsEnd& end) {
  DubinsEnd result = end;
  result.p_m = T * end.p_m;
  if (end.yaw_rad) *result.yaw_rad += T.yaw_rad;
  return result;
}

/// A pose of a box of half width `size_m` around the origin.
inline DubinsEnd random_end(Random& random, double size_m, double radius_m) {
  DubinsEnd end;
  end.p_m.x() = random.uniform(-size_m, size_m);
  end.p_m.y() = random.uniform(-size_m, size_m);
  end.yaw_rad = random.uniform(-kPi, kPi);
  end.radius_m = radius_m;
  return end;
}

/// A pose of a coarse grid, where circles touch, coincide and lie in one another.
inline DubinsEnd grid_end(Random& random, double radius_m) {
  DubinsEnd end;
  end.p_m.x() = std::floor(random.uniform(-4.0, 5.0));
  end.p_m.y() = std::floor(random.uniform(-4.0, 5.0));
  end.yaw_rad = 0.5 * kPi * std::floor(random.uniform(-2.0, 3.0));
  end.radius_m = radius_m;
  return end;
}

/// The greatest gap in position and heading: at the begin, between segments and at the end. From the segments' numbers
/// alone, as another program reads them. A straight's heading is that of its ends, if they are 0.1 mm apart at least.
inline double greatest_gap(const DubinsPath& path, const DubinsEnd& from, const DubinsEnd& to) {
  const std::string word = name_of(path.word);
  Pose2 at = from.yaw_rad ? pose_of(from) : Pose2{from.p_m, 0.0};
  bool heading_is_known = from.yaw_rad.has_value();
  double gap = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    Pose2 begin, end;
    if (word[i] == 'S') {
      const Straight& straight = std::get<Straight>(path.segments[i]);
      const Eigen::Vector2d way = straight.to_m - straight.from_m;
      const double heading_rad = way.norm() > 1e-4 ? std::atan2(way.y(), way.x()) : at.yaw_rad;
      begin = {straight.from_m, heading_rad};
      end = {straight.to_m, heading_rad};
      gap = std::max(gap, std::abs(wrap_to_pi(straight.heading_rad - heading_rad)));
    } else {
      const Arc& arc = std::get<Arc>(path.segments[i]);
      const double sign = word[i] == 'L' ? 1.0 : -1.0;
      const auto pose = [&arc, sign](double polar_rad) {
        const Eigen::Vector2d out(std::cos(polar_rad), std::sin(polar_rad));
        return Pose2{arc.center_m + arc.radius_m * out, polar_rad + sign * 0.5 * kPi};
      };
      begin = pose(arc.from_rad);
      end = pose(arc.from_rad + arc.sweep_rad);
      EXPECT_GE(sign * arc.sweep_rad, 0.0) << word << i;
      EXPECT_LT(sign * arc.sweep_rad, 2.0 * kPi) << word << i;
      EXPECT_EQ(arc.radius_m, i < 2 ? from.radius_m : to.radius_m);
    }
    if (!heading_is_known) at.yaw_rad = begin.yaw_rad;
    heading_is_known = true;
    gap = std::max(gap, distance(at, begin));
    at = end;
  }
  const Pose2 goal{to.p_m, to.yaw_rad ? *to.yaw_rad : at.yaw_rad};
  return std::max(gap, distance(at, goal));
}

inline double sum_of_segments_m(const DubinsPath& path) {
  return length_m(path.segments[0]) + length_m(path.segments[1]) + length_m(path.segments[2]);
}

}  // namespace situation_awareness
