// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/rounds.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace situation_awareness {
namespace {

/// Places on a circle at which a way to it may end.
constexpr int kEntries = 180;

Pose2 on_circle(const Eigen::Vector3d& circle, double polar_rad) {
  return {circle.head<2>() + circle.z() * Eigen::Vector2d(std::cos(polar_rad), std::sin(polar_rad)),
          polar_rad + 0.5 * kPi};
}

}  // namespace

Rounds::Rounds(const std::vector<Eigen::Vector3d>& circles, const RoundsParams& params, double max_curvature_1_m)
    : circles_(circles), params_((params.validate(), params)) {
  following_.max_curvature_1_m = max_curvature_1_m;
  following_.validate();
  if (circles.empty()) throw std::invalid_argument("there is no circle to fly around");
  for (const Eigen::Vector3d& circle : circles) {
    if (!may_turn(circle.z(), max_curvature_1_m)) {
      throw std::invalid_argument("a circle of " + std::to_string(circle.z()) + " m is tighter than the vehicle turns");
    }
  }
}

/// To the place on the circle to which it is nearest. It leaves a circle and comes to one by left turns of its radius,
/// so that it does not cut into one.
void Rounds::plan_way(const Pose2& from) {
  double least_m = std::numeric_limits<double>::infinity();
  const double radius_m = circles_[circle_].z();
  const DubinsEnd begin{from.translation_m, from.yaw_rad, circle_ > 0 ? circles_[circle_ - 1].z() : params_.radius_m};
  for (int i = 0; i < kEntries; ++i) {
    const double polar_rad = 2.0 * kPi * i / kEntries;
    const Pose2 entry = on_circle(circles_[circle_], polar_rad);
    for (const DubinsWord word : {DubinsWord::kLsl, DubinsWord::kRsl}) {
      if (word == DubinsWord::kRsl && circle_ > 0) continue;
      const auto path = dubins_path(word, begin, {entry.translation_m, entry.yaw_rad, radius_m});
      if (!path || path->length_m >= least_m) continue;
      least_m = path->length_m;
      entry_rad_ = polar_rad;
      path_ = *path;
    }
  }
}

void Rounds::plan_round() {
  const Eigen::Vector3d& circle = circles_[circle_];
  const double sweep_rad = 2.0 * kPi * params_.laps;
  const Pose2 end = on_circle(circle, entry_rad_ + sweep_rad);
  path_.word = DubinsWord::kLsl;
  path_.segments = {Arc{circle.head<2>(), circle.z(), entry_rad_, sweep_rad},
                    Straight{end.translation_m, end.translation_m, end.yaw_rad},
                    Arc{circle.head<2>(), circle.z(), entry_rad_ + sweep_rad, 0.0}};
  path_.length_m = circle.z() * sweep_rad;
  entry_rad_ += sweep_rad;
}

double Rounds::turn_rate(const Pose2& T_world_course, double speed_m_s) {
  if (paths_ == 0) {
    plan_way(T_world_course);
    ++paths_;
  }
  DubinsFollowingResult result = follow(path_, following_, T_world_course, speed_m_s, way_m_);
  if (result.arrived) {
    if (!around_) {
      around_ = true;
      plan_round();
    } else if (circle_ + 1 < circles_.size()) {
      around_ = false;
      ++circle_;
      plan_way(T_world_course);
    } else {
      done_ = true;
      plan_round();
    }
    ++paths_;
    way_m_ = 0.0;
    result = follow(path_, following_, T_world_course, speed_m_s, way_m_);
  }
  way_m_ = result.way_m;
  return result.curvature_1_m * speed_m_s;
}

}  // namespace situation_awareness
