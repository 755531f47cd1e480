// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/geometry/ellipses_by_x.hpp"
#include "situation_awareness/map/objects/object_filter.hpp"
#include "situation_awareness/map/objects/objects.hpp"

namespace situation_awareness {

struct ObjectMapParams {
  double acceleration_noise = 0.4;
  double angular_acceleration_noise = 0.3;
  double radius_noise = 0.005;
  double initial_velocity_sigma_m_s = 1.0;
  double initial_angular_velocity_sigma_rad_s = 0.3;
  double robot_position_sigma_m = 0.01;
  double robot_yaw_sigma_rad = 0.003;
  double measurement_sigma_m = 0.02;
  double hidden_end_factor = 10.0;
  double gate_probability = 0.999;
  double min_observations = 3.0;
  double hidden_observation_weight = 0.25;
  double max_position_sigma_m = 0.4;
  double max_velocity_sigma_m_s = 5.0;
  double max_radius_sigma_m = 0.5;
  double reset_time_jump_s = 1.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("acceleration_noise", self.acceleration_noise, Bounds{0.0, 100.0}, "m/s^2/sqrt(Hz)",
          "spectral density of the white acceleration that moves objects off constant velocity");
    visit("angular_acceleration_noise", self.angular_acceleration_noise, Bounds{0.0, 100.0}, "rad/s^2/sqrt(Hz)",
          "spectral density of the white angular acceleration");
    visit("radius_noise", self.radius_noise, Bounds{0.0, 1.0}, "m/sqrt(s)",
          "random walk of the radii: the shape a detector sees changes with the side it looks at");
    visit("initial_velocity_sigma_m_s", self.initial_velocity_sigma_m_s, Bounds{0.0, 100.0}, "m/s",
          "standard deviation of the velocity of a new element (ellipse paper, eq. 17)");
    visit("initial_angular_velocity_sigma_rad_s", self.initial_angular_velocity_sigma_rad_s, Bounds{0.0, 100.0},
          "rad/s", "standard deviation of the angular velocity of a new element (ellipse paper, eq. 19)");
    visit("robot_position_sigma_m", self.robot_position_sigma_m, Bounds{0.0, 10.0}, "m",
          "standard deviation of the robot's position, per axis");
    visit("robot_yaw_sigma_rad", self.robot_yaw_sigma_rad, Bounds{0.0, 1.0}, "rad",
          "standard deviation of the robot's yaw");
    visit("measurement_sigma_m", self.measurement_sigma_m, Bounds{0.0, 1.0}, "m",
          "added to each detection's own standard deviation of centre and radii");
    visit("hidden_end_factor", self.hidden_end_factor, Bounds{1.0, 100.0}, "",
          "a detection's own standard deviations grow by this where an end is hidden: such errors repeat from scan to "
          "scan");
    visit("gate_probability", self.gate_probability, Bounds{0.5, 0.999999}, "",
          "part of an element's true detections that its chi-square gate lets in");
    visit("min_observations", self.min_observations, Bounds{1.0, 1000.0}, "",
          "an element is on the map from this many observations on");
    visit("hidden_observation_weight", self.hidden_observation_weight, Bounds{0.0, 1.0}, "",
          "what an observation with a hidden end counts for that: it may be a piece of anything");
    visit("max_position_sigma_m", self.max_position_sigma_m, Bounds{0.001, 1000.0}, "m",
          "an element is deleted when its position is less certain in any direction");
    visit("max_velocity_sigma_m_s", self.max_velocity_sigma_m_s, Bounds{0.001, 1000.0}, "m/s",
          "an element is deleted when its velocity is less certain in any direction");
    visit("max_radius_sigma_m", self.max_radius_sigma_m, Bounds{0.001, 1000.0}, "m",
          "an element is deleted when its radii are less certain in any direction");
    visit("reset_time_jump_s", self.reset_time_jump_s, Bounds{0.0, 1e6}, "s",
          "time going back by more than this starts a new map (a bag that loops); by less, the scan is dropped");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// What one update did.
struct ObjectMapUpdate {
  std::vector<std::uint64_t> updated;  ///< ids
  std::vector<std::uint64_t> created;  ///< ids
  std::vector<std::uint64_t> deleted;  ///< ids
  Counters reasons;                    ///< why elements were deleted or the whole update was dropped
};

/// The semantic map of ellipses: one error-state EKF per element (ellipse paper, Sect. V; circle paper, Sect. V-B),
/// written out in docs/math/objects.md. The elements are independent given the robot's pose, which is an input with a
/// covariance, so the cost grows linearly with the elements.
class ObjectMap {
 public:
  /// Throws std::invalid_argument naming field and bound.
  explicit ObjectMap(const ObjectMapParams& params);

  /// Predict to the stamp of the detections, associate one to one, update, map what is new, delete what is outdated.
  ObjectMapUpdate update(const Detections& detections);

  /// The map at any time from the latest update on, by prediction (earlier times: as of the latest update). Elements
  /// with less evidence than min_observations are left out.
  Objects at(std::int64_t stamp_ns) const;

  /// Stamp of the latest update, kNoStamp before the first.
  std::int64_t stamp_ns() const { return order_.latest_ns(); }
  static constexpr std::int64_t kNoStamp = StampOrder::kNone;

 private:
  /// One element with its filter.
  struct Element {
    std::uint64_t id = 0;
    ObjectState x;
    Matrix8d P = Matrix8d::Zero();
    std::int64_t first_seen_ns = 0;
    std::int64_t last_seen_ns = 0;
    int observations = 0;
    double evidence = 0.0;  ///< observations, weighted by what they say of its existence
    int beams = 0;
  };

  /// A measurement that is of an element.
  struct Association {
    std::size_t element;
    std::size_t measurement;
    Match match;
  };

  /// False, and the map unchanged, if the stamp may not follow the latest.
  bool advance_to(std::int64_t stamp_ns, ObjectMapUpdate& report);
  void predict_elements(double dt_s);
  void bound_unobservable(Matrix8d& P) const;
  Measurement measurement_of(const Detection& detection) const;
  std::vector<Association> associate(const std::vector<Measurement>& measurements, const Pose2& T_world_level) const;
  Element new_element(const Measurement& measurement, const Pose2& T_world_level);
  void observe(Element& element, const Detection& detection) const;
  EllipsesByX seen_now() const;
  void delete_outdated(ObjectMapUpdate& report);

  ObjectMapParams params_;
  StampOrder order_;
  double gate_;  ///< of the squared Mahalanobis distance
  ProcessNoise process_noise_;
  Eigen::Matrix3d robot_covariance_;
  std::vector<Element> elements_;  ///< by growing id
  double height_world_m_ = 0.0;
  std::uint64_t next_id_ = 1;
};

}  // namespace situation_awareness
