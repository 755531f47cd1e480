// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/estimation/assignment.hpp"
#include "situation_awareness/geometry/ellipses_by_x.hpp"
#include "situation_awareness/map/objects/map_snapshot.hpp"
#include "situation_awareness/map/objects/motion_models.hpp"
#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/map/objects/visibility.hpp"

namespace situation_awareness {

/// How objects move, how far detections and poses can be trusted, and when an element is on the map.
struct ObjectMapParams {
  std::string shape = "ellipse";
  double acceleration_sigma_m_s2 = 0.4;
  double angular_acceleration_sigma_rad_s2 = 0.3;
  double standing_drift_m = 0.002;
  double radius_drift_m = 0.002;
  double start_rate_1_s = 0.005;
  double restart_rate_1_s = 0.5;
  double stop_rate_1_s = 0.1;
  double start_velocity_sigma_m_s = 1.0;
  double start_angular_velocity_sigma_rad_s = 0.3;
  double robot_position_sigma_m = 0.01;
  double robot_yaw_sigma_rad = 0.003;
  double robot_stamp_sigma_s = 0.002;
  double measurement_sigma_m = 0.01;
  double hidden_end_factor = 3.0;
  double correlated_error_fraction = 0.4;
  double gate_probability = 0.999;
  double birth_probability = 0.2;
  double confirmation_probability = 0.75;
  double deletion_probability = 0.05;
  double detection_probability = 0.6;
  double hidden_observation_weight = 0.25;
  double max_part_radius_m = 0.15;
  double max_part_gap_m = 0.3;
  double min_part_travel_m = 0.4;
  double max_position_sigma_m = 0.24;
  double lost_position_sigma_m = 10.0;
  double max_unseen_s = 60.0;
  double reset_time_jump_s = 1.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("shape", self.shape, "model of the objects' shape: ellipse, or circle (circle paper)");
    visit("acceleration_sigma_m_s2", self.acceleration_sigma_m_s2, Bounds{0.0, 100.0}, "m/s^2",
          "standard deviation of a moving object's acceleration, per axis, with a correlation time of about 0.5 s");
    visit("angular_acceleration_sigma_rad_s2", self.angular_acceleration_sigma_rad_s2, Bounds{0.0, 100.0}, "rad/s^2",
          "standard deviation of a moving object's angular acceleration, with a correlation time of about 0.5 s");
    visit("standing_drift_m", self.standing_drift_m, Bounds{0.0, 1.0}, "m",
          "process noise of a standing object's position: standard deviation after 1 s, per axis");
    visit("radius_drift_m", self.radius_drift_m, Bounds{0.0, 1.0}, "m",
          "process noise of (rx + ry) / 2 and (rx - ry) / 2: standard deviation after 1 s; radii are constant, but "
          "detections of real objects vary with the direction of view");
    visit("start_rate_1_s", self.start_rate_1_s, Bounds{0.0, 100.0}, "1/s",
          "transition rate from standing to moving of an object that has not been observed to move");
    visit("restart_rate_1_s", self.restart_rate_1_s, Bounds{0.0, 100.0}, "1/s",
          "transition rate from standing to moving of an object that has moved, or has not been observed to stand for "
          "long yet");
    visit("stop_rate_1_s", self.stop_rate_1_s, Bounds{0.0, 100.0}, "1/s", "transition rate from moving to standing");
    visit("start_velocity_sigma_m_s", self.start_velocity_sigma_m_s, Bounds{0.0, 100.0}, "m/s",
          "prior standard deviation, per axis, of the velocity of a new object and of one that starts to move (ellipse "
          "paper, eq. 17)");
    visit("start_angular_velocity_sigma_rad_s", self.start_angular_velocity_sigma_rad_s, Bounds{0.0, 100.0}, "rad/s",
          "prior standard deviation of the angular velocity of a new object and of one that starts to move (ellipse "
          "paper, eq. 19)");
    visit("robot_position_sigma_m", self.robot_position_sigma_m, Bounds{0.0, 10.0}, "m",
          "standard deviation of the robot's position, per axis");
    visit("robot_yaw_sigma_rad", self.robot_yaw_sigma_rad, Bounds{0.0, 1.0}, "rad",
          "standard deviation of the robot's yaw");
    visit("robot_stamp_sigma_s", self.robot_stamp_sigma_s, Bounds{0.0, 1.0}, "s",
          "standard deviation of the time offset between the stamps of scan and pose, which matters as the robot moves "
          "and turns");
    visit("measurement_sigma_m", self.measurement_sigma_m, Bounds{0.0, 1.0}, "m",
          "standard deviation that is added in quadrature to that of each detection's centre and radii");
    visit("hidden_end_factor", self.hidden_end_factor, Bounds{1.0, 100.0}, "",
          "factor on the standard deviations of a detection with an occluded end");
    visit("correlated_error_fraction", self.correlated_error_fraction, Bounds{0.0, 1.0}, "",
          "fraction of a detection's variance that is correlated from scan to scan while the view is the same; "
          "averaging does not reduce it");
    visit("gate_probability", self.gate_probability, Bounds{0.5, 0.999999}, "",
          "probability that the chi-square gate accepts a true detection of an element", kLive);
    visit("birth_probability", self.birth_probability, Bounds{0.001, 0.999}, "",
          "probability of existence of a new, tentative element");
    visit(
        "confirmation_probability", self.confirmation_probability, Bounds{0.001, 0.999}, "",
        "probability of existence at which an element is confirmed; it is published while the probability is above 0.5",
        kLive);
    visit("deletion_probability", self.deletion_probability, Bounds{0.0, 0.5}, "",
          "probability of existence below which an element is deleted", kLive);
    visit("detection_probability", self.detection_probability, Bounds{0.01, 0.99}, "",
          "probability that an unoccluded object is detected in a scan");
    visit("hidden_observation_weight", self.hidden_observation_weight, Bounds{0.0, 1.0}, "",
          "weight of a detection with an occluded end in the update of the probability of existence");
    visit("max_part_radius_m", self.max_part_radius_m, Bounds{0.0, 10.0}, "m",
          "maximum mean radius of an element that may be part of a body (a limb)");
    visit("max_part_gap_m", self.max_part_gap_m, Bounds{0.0, 10.0}, "m", "maximum gap between a part and its body");
    visit("min_part_travel_m", self.min_part_travel_m, Bounds{0.01, 100.0}, "m",
          "distance that two elements must move together to become one body");
    visit("max_position_sigma_m", self.max_position_sigma_m, Bounds{0.001, 1000.0}, "m",
          "maximum standard deviation of the position in any direction of an element that is published (circle paper, "
          "eq. 33)",
          kLive);
    visit("lost_position_sigma_m", self.lost_position_sigma_m, Bounds{0.001, 1000.0}, "m",
          "maximum standard deviation of the position in any direction of a lost element that is kept for "
          "re-identification");
    visit("max_unseen_s", self.max_unseen_s, Bounds{0.0, 1e6}, "s",
          "maximum time without a detection, after which an element is deleted", kLive);
    visit("reset_time_jump_s", self.reset_time_jump_s, Bounds{0.0, 1e6}, "s",
          "a stamp that goes back by more than this starts a new map (a bag that loops); a scan that goes back by less "
          "is dropped");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// What one update did.
struct ObjectMapUpdate {
  std::vector<std::uint64_t> updated;  ///< ids
  std::vector<std::uint64_t> created;  ///< ids
  std::vector<std::uint64_t> deleted;  ///< ids
  Counters reasons;                    ///< why elements were deleted, matches rejected or the whole update dropped
  std::uint64_t matches = 0;           ///< detections that corrected an element
  double mahalanobis2 = 0.0;           ///< sum of their squared Mahalanobis distances, each under the likelier motion
  double log_likelihood = 0.0;         ///< of the detections of `updated` and `created`: what tunes the filter
};

/// The semantic map of ellipses: for each element an EKF under two motions (ellipse paper, Sect. V; circle paper,
/// Sect. V-B) and a probability of existence, written out in docs/math/objects.md. The elements are independent given
/// the robot's pose, which is an input with a covariance, so the cost grows linearly with the elements.
class ObjectMap {
 public:
  /// Throws std::invalid_argument naming field and bound.
  explicit ObjectMap(const ObjectMapParams& params);

  /// Other parameters from the next update on; the elements stay. Throws std::invalid_argument naming field and bound,
  /// and for another shape; the old ones then stay.
  void set_params(const ObjectMapParams& params);

  /// Predict to the stamp of the detections, associate one to one, update, make what should have been detected less
  /// probable, map what is new, join what moves as one, delete what is not there any more. None of the detections has a
  /// detection_defect, and their pose is finite. `memory`: a report no longer needed, whose memory this one takes over;
  /// with it nothing is asked of the heap but for more elements or detections than before.
  ObjectMapUpdate update(const Detections& detections, ObjectMapUpdate memory = {});

  /// The map at any time from the latest update on, by prediction of up to an hour (earlier times: as of the latest
  /// update). Elements that are not confirmed, and those that are part of another, are left out.
  Objects at(std::int64_t stamp_ns, Objects memory = {}) const;

  /// How many elements are alive, on the map or not.
  std::size_t size() const { return elements_.size(); }

  /// Stamp of the latest update, kNoStamp before the first.
  std::int64_t stamp_ns() const { return order_.latest_ns(); }
  static constexpr std::int64_t kNoStamp = StampOrder::kNone;

  /// Forget everything and start anew, at whatever time. Ids go on.
  void reset();

  /// All that is known; `world_frame` is left empty. Before the first update there is nothing to keep: `stamp_ns` is
  /// then kNoStamp.
  MapSnapshot snapshot() const;

  /// Become the map that the snapshot is of; what comes next does to this one, bit for bit, what it would have done to
  /// that. New ids are above those of both maps. Throws std::invalid_argument as MapSnapshot::validate, or if the
  /// snapshot is of another shape; this map is then unchanged.
  void restore(const MapSnapshot& snapshot);

  /// The same at another time and maybe place of the robot, as if no time had passed since the snapshot: all its stamps
  /// are moved to the latest update of this map, if there was one, and then to the next, whatever its stamp. That one
  /// finds everything where it was, and nothing is concluded from where the robot was.
  void resume(const MapSnapshot& snapshot);

 private:
  /// What is known of one element, and what is found out anew in each update.
  struct Element : MapElement {
    bool just_confirmed = false;
    bool common_shape = false;  ///< others look the same
    bool known_again = false;   ///< it is another, which goes on in its place
  };

  /// A measurement that is of an element.
  struct Association {
    std::size_t element;
    std::size_t measurement;
    MotionMatch match;
  };

  /// Why a measurement near elements is of none: what speaks against the likeliest of them.
  struct Rejection {
    const char* reason = "";  ///< empty: none is near
    double log_likelihood = -std::numeric_limits<double>::infinity();
  };

  /// A measurement's place, to look for it by.
  struct Place {
    Eigen::Vector2d center_world_m;
    int measurement;
  };

  /// An ellipse that others may be part of.
  struct Body {
    Ellipse ellipse_world;
    std::size_t element;
  };

  /// Whether the scan should have a detection of an element.
  struct ExpectedDetection {
    Ellipse ellipse_world;  ///< where, by the more probable motion
    Sight sight = Sight::kHidden;
    double probability = 0.0;  ///< that there is one, if the element exists
  };

  /// What is kept for its memory from scan to scan, and means nothing between updates.
  struct Workspace {
    std::vector<Measurement> measurements;
    std::vector<char> used;  ///< measurements
    EllipsesByX seen_lately;
    EllipsesByX seen_now;
    std::vector<ExpectedDetection> expected;  ///< of the elements
    std::vector<Place> by_x;
    std::vector<char> on_seen;          ///< measurements
    std::vector<Rejection> rejections;  ///< of the measurements
    std::vector<Candidate> candidates;
    std::vector<MotionMatch> matches;  ///< of the candidates
    std::vector<int> measurement_of_element;
    std::vector<Association> associations;
    std::vector<std::pair<double, std::size_t>> by_mean_radius;
    std::vector<Body> bodies;
    std::vector<char> drop;  ///< elements
  };

  /// False, and the map unchanged, if the stamp may not follow the latest.
  bool advance_to(std::int64_t stamp_ns, ObjectMapUpdate& report);
  void move_stamps_to(std::int64_t stamp_ns);
  void forget();
  Eigen::Matrix3d robot_covariance(const Detections& detections);
  void learn_noise(double mahalanobis2);
  Measurement widened(const Detection& detection) const;
  void associate(const Pose2& T_world_level, const Eigen::Matrix3d& U);
  const char* mismatch(const Element& element, const MotionMatch& match) const;
  Element* in_the_place_of(const Measurement& measurement, const Pose2& T_world_level);
  MotionEstimate new_estimate(const Measurement& measurement, const Pose2& T_world_level,
                              const Eigen::Matrix3d& U) const;
  Element new_element(const Measurement& measurement, const Pose2& T_world_level, const Eigen::Matrix3d& U);
  void observe(Element& element, const Detection& detection, const Measurement& measurement,
               const Pose2& T_world_level) const;
  EllipsesByX seen_within(double past_s, EllipsesByX memory) const;
  MotionParams motion_of(const Element& element) const;
  void expect_detections(const Detections& detections);
  double log_detection_ratio(std::size_t element) const;
  void missed_detection_update();
  void compare_shapes();
  void recognise_lost();
  void join_parts();
  void delete_outdated(ObjectMapUpdate& report);
  const Element* find(std::uint64_t id) const;
  double unseen_s(const Element& element) const { return seconds_between(element.last_seen_ns, stamp_ns()); }
  double uncertain_by_m(const Element& element) const;
  bool shown(const Element& element) const;

  ObjectMapParams params_;
  MotionParams motion_;
  StampOrder order_;
  double gate_;                    ///< of the squared Mahalanobis distance
  std::vector<Element> elements_;  ///< by growing id
  Pose2 T_world_level_;            ///< of the latest update
  double noise_ = 1.0;             ///< how much larger errors are than the detections say, squared
  double step_s_ = 0.0;            ///< from the update before to the latest
  double height_world_m_ = 0.0;
  std::uint64_t next_id_ = 1;
  bool resumed_ = false;  ///< and not updated since: its time is that of the next update
  Workspace work_;
};

}  // namespace situation_awareness
