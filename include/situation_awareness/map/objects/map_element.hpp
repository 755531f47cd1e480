// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/map/objects/motion_models.hpp"
#include "situation_awareness/map/objects/objects.hpp"

namespace situation_awareness {

/// Bounds of valid maps, wider than any real one.
namespace map_bounds {
constexpr Bounds kProbability{0.0, 1.0};
constexpr Bounds kLogOdds{-1e9, 7.0};
constexpr Bounds kBoxLogOdds{kSurelyEllipse, -kSurelyEllipse};
constexpr Bounds kNoise{1.0, 100.0};
constexpr Bounds kState{-1e6, 1e6};    ///< m, m/s, rad/s
constexpr Bounds kVariance{0.0, 1e9};  ///< their squares
constexpr Bounds kDuration_s{0.0, 1e9};
constexpr std::int64_t kEnd_ns = (std::int64_t{1} << 32) * 1'000'000'000;  ///< stamps are from 1970 to 2106, as in ROS
constexpr std::int64_t kMaxAge_ns = std::int64_t{1} << 61;                 ///< 73 years
constexpr std::uint64_t kMaxId = std::uint64_t{1} << 53;
constexpr std::size_t kMaxElements = 20'000;  ///< of a map: no more are made; some seconds to load, 90 MB
}  // namespace map_bounds

/// State of an element: tentative -> confirmed <-> lost -> deleted. The transitions are in existence.hpp; that from
/// tentative to deleted of an element that is re-identified as a lost one is in re_identification.hpp.
enum class TrackState {
  kTentative,  ///< not confirmed yet: deleted when not detected again soon
  kConfirmed,  ///< confirmed, and detected recently
  kLost,       ///< confirmed, but not detected recently: it is predicted, and may be re-identified
  kDeleted,    ///< removed at the end of the update
};

/// As in map files: "tentative", "confirmed", "lost", "deleted".
const char* name_of(TrackState state);

/// As a field of a map file, which has no deleted elements.
std::string yaml_text(TrackState state);
void read_yaml_text(const std::string& text, TrackState& state);
std::string yaml_text(ObjectClass object_class);
void read_yaml_text(const std::string& text, ObjectClass& object_class);

/// State of one element between updates.
struct MapElement {
  std::uint64_t id = 0;
  MotionEstimate estimate;
  Matrix8d P_view = Matrix8d::Zero();  ///< of the best recent detection from the current viewpoint
  double log_odds = 0.0;               ///< of existence
  TrackState state = TrackState::kTentative;
  std::int64_t first_seen_ns = 0;
  std::int64_t last_seen_ns = 0;
  int observations = 0;
  int beams = 0;
  double stood_s = 0.0;                                       ///< time for which it was seen to stand
  int moving_scans = 0;                                       ///< detections in a row with which it surely moves
  bool mobile = false;                                        ///< it has travelled
  Eigen::Vector2d set_off_world_m = Eigen::Vector2d::Zero();  ///< where it began to move
  std::uint64_t body = 0;  ///< id of the element that it is, or may be, a part of; 0: none
  bool is_part = false;    ///< it is part of `body`
  bool has_parts = false;  ///< it has had parts
  Eigen::Vector2d met_world_m = Eigen::Vector2d::Zero();       ///< its position when it met `body`
  Eigen::Vector2d body_met_world_m = Eigen::Vector2d::Zero();  ///< position of `body` then
  ObjectClass object_class = ObjectClass::kUnknown;            ///< the likeliest
  double p_class = 0.0;                                        ///< its probability; 0 for kUnknown
  std::uint64_t other_leg = 0;      ///< id of the element that may be the other leg of a person; 0: none
  double other_leg_log_odds = 0.0;  ///< that it is
  Eigen::Vector2d leg_offset_world_m = Eigen::Vector2d::Zero();  ///< of a person: of its first leg from the middle
  double leg_offset_variance_m2 = 0.0;                           ///< of that, per axis
  double box_log_odds = kSurelyEllipse;                          ///< that it is a box rather than an ellipse
  double box_psi_rad = 0.0;                                      ///< in the world, of the latest detection as a box

  /// Every field with its name in a map file (map/map_fields.hpp).
  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    using namespace map_bounds;
    visit("id", self.id, 1, kMaxId);
    visit("state", self.state);
    visit("log_odds", self.log_odds, kLogOdds);
    visit("p_moving", self.estimate.p_moving, kProbability);
    visit("first_seen_ns", self.first_seen_ns, -kMaxAge_ns, kEnd_ns);
    visit("last_seen_ns", self.last_seen_ns, -kMaxAge_ns, kEnd_ns);
    visit("observations", self.observations);
    visit("beams", self.beams);
    visit("stood_s", self.stood_s, kDuration_s);
    visit("moving_scans", self.moving_scans);
    visit("mobile", self.mobile);
    visit("set_off_world", self.set_off_world_m, kState);
    visit("body", self.body, 0, kMaxId);
    visit("is_part", self.is_part);
    visit("has_parts", self.has_parts);
    visit("met_world", self.met_world_m, kState);
    visit("body_met_world", self.body_met_world_m, kState);
    visit("class", self.object_class);
    visit("p_class", self.p_class, kProbability);
    visit("other_leg", self.other_leg, 0, kMaxId);
    visit("other_leg_log_odds", self.other_leg_log_odds, kLogOdds);
    visit("leg_offset_x_m", self.leg_offset_world_m.x(), kState);
    visit("leg_offset_y_m", self.leg_offset_world_m.y(), kState);
    visit("leg_offset_variance_m2", self.leg_offset_variance_m2, kVariance);
    visit("box_log_odds", self.box_log_odds, kBoxLogOdds);
    visit("box_psi", self.box_psi_rad, kState);
    visit("standing", self.estimate.standing.x, kState);
    visit("standing_covariance", self.estimate.standing.P, kVariance);
    visit("moving", self.estimate.moving.x, kState);
    visit("moving_covariance", self.estimate.moving.P, kVariance);
    visit("view_covariance", self.P_view, kVariance);
  }
};

/// True if the element is a person, known by the legs (people.hpp).
inline bool is_person(const MapElement& element) { return element.object_class == ObjectClass::kPerson; }

/// Time since the element's last detection.
inline double unseen_s(const MapElement& element, std::int64_t stamp_ns) {
  return seconds_between(element.last_seen_ns, stamp_ns);
}

/// The estimate under the more probable of the two motions.
inline const ObjectEstimate& likelier(const MotionEstimate& estimate) {
  return estimate.p_moving > 0.5 ? estimate.moving : estimate.standing;
}

inline Eigen::Vector2d position(const ObjectEstimate& estimate) {
  return estimate.x.segment<2>(object_state::kPosition);
}

/// The element with this id, of elements by ascending id; null if there is none.
const MapElement* find_element(std::uint64_t id, const std::vector<MapElement>& elements);

/// The later element `heir` goes on under the id of `element`, in its place, so that ids still ascend; `element` itself
/// is dropped under the other's id.
void take_over_id(std::size_t element, std::size_t heir, std::vector<MapElement>& elements, std::vector<char>& dropped);

/// Standard deviation of a position with this covariance in its least certain direction.
double largest_sigma_m(const Eigen::Matrix2d& covariance_m2);
/// Standard deviation of the element's position in its least certain direction.
double position_sigma_m(const ObjectEstimate& estimate);

}  // namespace situation_awareness
