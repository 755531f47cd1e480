// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/map/objects/motion_models.hpp"
#include "situation_awareness/map/objects/objects.hpp"

namespace situation_awareness {

/// Bounds of what a map holds: wider than any map that makes sense.
namespace map_bounds {
constexpr Bounds kProbability{0.0, 1.0};
constexpr Bounds kLogOdds{-1e9, 7.0};
constexpr Bounds kNoise{1.0, 100.0};
constexpr Bounds kState{-1e6, 1e6};    ///< m, m/s, rad/s
constexpr Bounds kVariance{0.0, 1e9};  ///< their squares
constexpr Bounds kDuration_s{0.0, 1e9};
constexpr std::int64_t kEnd_ns = (std::int64_t{1} << 32) * 1'000'000'000;  ///< stamps are from 1970 to 2106, as in ROS
constexpr std::int64_t kMaxAge_ns = std::int64_t{1} << 61;                 ///< 73 years
constexpr std::uint64_t kMaxId = std::uint64_t{1} << 53;
constexpr std::size_t kMaxElements = 2000;  ///< which load in 2 s
}  // namespace map_bounds

/// All that the map knows of one element from one update to the next.
struct MapElement {
  std::uint64_t id = 0;
  MotionEstimate estimate;
  Matrix8d P_view = Matrix8d::Zero();  ///< of one detection from the side it was seen from lately, at its best
  double log_odds = 0.0;               ///< of its existence
  bool confirmed = false;
  std::int64_t first_seen_ns = 0;
  std::int64_t last_seen_ns = 0;
  int observations = 0;
  int beams = 0;
  double stood_s = 0.0;                                       ///< for how long it was seen to stand
  bool moves = false;                                         ///< it is surely on its way
  bool mobile = false;                                        ///< it has travelled
  Eigen::Vector2d set_off_world_m = Eigen::Vector2d::Zero();  ///< where it was when `moves` began
  std::uint64_t body = 0;  ///< id of the element that it is part of, or may be; 0: of none
  bool is_part = false;    ///< it is part of `body`
  bool has_parts = false;  ///< others were part of it
  Eigen::Vector2d met_world_m = Eigen::Vector2d::Zero();       ///< where it was when it met `body`
  Eigen::Vector2d body_met_world_m = Eigen::Vector2d::Zero();  ///< where `body` was

  /// Every field, by the name that it has in a map file; the map file and the check both read this list.
  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    using namespace map_bounds;
    visit("id", self.id, 1, kMaxId);
    visit("confirmed", self.confirmed);
    visit("log_odds", self.log_odds, kLogOdds);
    visit("p_moving", self.estimate.p_moving, kProbability);
    visit("first_seen_ns", self.first_seen_ns, -kMaxAge_ns, kEnd_ns);
    visit("last_seen_ns", self.last_seen_ns, -kMaxAge_ns, kEnd_ns);
    visit("observations", self.observations);
    visit("beams", self.beams);
    visit("stood_s", self.stood_s, kDuration_s);
    visit("moves", self.moves);
    visit("mobile", self.mobile);
    visit("set_off_world", self.set_off_world_m, kState);
    visit("body", self.body, 0, kMaxId);
    visit("is_part", self.is_part);
    visit("has_parts", self.has_parts);
    visit("met_world", self.met_world_m, kState);
    visit("body_met_world", self.body_met_world_m, kState);
    visit("standing", self.estimate.standing.x, kState);
    visit("standing_covariance", self.estimate.standing.P, kVariance);
    visit("moving", self.estimate.moving.x, kState);
    visit("moving_covariance", self.estimate.moving.P, kVariance);
    visit("view_covariance", self.P_view, kVariance);
  }
};

/// All that an ObjectMap knows after an update, and so all that it takes to go on from there.
struct MapSnapshot {
  std::string world_frame;        ///< for whoever keeps the snapshot: the map itself knows no names of frames
  std::string shape = "ellipse";  ///< ObjectMapParams::shape
  std::int64_t stamp_ns = 0;      ///< of the latest update
  double step_s = 0.0;            ///< from the update before to the latest
  Pose2 T_world_level;            ///< of the latest update
  double height_world_m = 0.0;
  double noise = 1.0;                ///< how much larger errors are than the detections say, squared
  std::uint64_t next_id = 1;         ///< of what is new: larger than any that was given
  std::vector<MapElement> elements;  ///< by growing id

  /// Every field but the elements, as MapElement::fields does.
  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    using namespace map_bounds;
    visit("world_frame", self.world_frame);
    visit("shape", self.shape);
    visit("stamp_ns", self.stamp_ns, 0, kEnd_ns);
    visit("step_s", self.step_s, kDuration_s);
    visit("world_level", self.T_world_level, kState);
    visit("height_world_m", self.height_world_m, kState);
    visit("noise_factor", self.noise, kNoise);
    visit("next_id", self.next_id, 1, kMaxId);
  }

  /// Throws std::invalid_argument with one sentence that names element and field if no map can be so: a number that is
  /// not finite or out of bounds, a covariance that is not symmetric and positive semidefinite, radii that are not
  /// positive, ids that do not grow or are not below `next_id`, a body that is not there, a stamp after the latest
  /// update. `world_frame` may be empty.
  void validate() const;
};

}  // namespace situation_awareness
