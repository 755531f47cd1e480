// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/common/params.hpp"

namespace situation_awareness {

/// Parameters of motion, of the uncertainty of detections and poses, and of existence.
struct ObjectMapParams {
  std::string shape = "ellipse";
  double acceleration_sigma_m_s2 = 0.4;
  double angular_acceleration_sigma_rad_s2 = 0.3;
  double robot_position_sigma_m = 0.01;
  double robot_yaw_sigma_rad = 0.003;
  double robot_stamp_sigma_s = 0.002;
  double measurement_sigma_m = 0.01;
  double gate_probability = 0.999;
  double confirmation_probability = 0.75;
  double deletion_probability = 0.05;
  double max_position_sigma_m = 0.24;
  double lost_position_sigma_m = 10.0;
  double max_unseen_s = 60.0;

  // Constants of the method, which are not read from YAML.
  /// Process noise of a standing object's position: standard deviation after 1 s, per axis.
  double standing_drift_m = 0.002;
  /// Process noise of (rx + ry) / 2 and (rx - ry) / 2: standard deviation after 1 s; radii are constant, but detections
  /// of real objects vary with the direction of view.
  double radius_drift_m = 0.002;
  /// Fraction of a detection's variance that is correlated from scan to scan while the view is the same; averaging does
  /// not reduce it.
  double correlated_error_fraction = 0.4;
  /// Probability of existence of a new, tentative element.
  double birth_probability = 0.2;
  /// Weight of a detection with an occluded end in the update of the probability of existence, of at least 10 scans per
  /// second.
  double hidden_observation_weight = 0.25;
  /// Probability that an unoccluded object is detected in a scan.
  double detection_probability = 0.6;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("shape", self.shape, "model of the objects' shape: ellipse, or circle (circle paper)");
    visit("acceleration_sigma_m_s2", self.acceleration_sigma_m_s2, Bounds{0.0, 100.0}, "m/s^2",
          "standard deviation of a moving object's acceleration, per axis, with a correlation time of about 0.5 s");
    visit("angular_acceleration_sigma_rad_s2", self.angular_acceleration_sigma_rad_s2, Bounds{0.0, 100.0}, "rad/s^2",
          "standard deviation of a moving object's angular acceleration, with a correlation time of about 0.5 s");
    visit("robot_position_sigma_m", self.robot_position_sigma_m, Bounds{0.0, 10.0}, "m",
          "standard deviation of the robot's position, per axis");
    visit("robot_yaw_sigma_rad", self.robot_yaw_sigma_rad, Bounds{0.0, 1.0}, "rad",
          "standard deviation of the robot's yaw");
    visit("robot_stamp_sigma_s", self.robot_stamp_sigma_s, Bounds{0.0, 1.0}, "s",
          "standard deviation of the time offset between the stamps of scan and pose, which matters as the robot moves "
          "and turns");
    visit("measurement_sigma_m", self.measurement_sigma_m, Bounds{0.0, 1.0}, "m",
          "standard deviation that is added in quadrature to that of each detection's centre and radii");
    visit("gate_probability", self.gate_probability, Bounds{0.5, 0.999999}, "",
          "probability that the chi-square gate accepts a true detection of an element", kLive);
    visit(
        "confirmation_probability", self.confirmation_probability, Bounds{0.001, 0.999}, "",
        "probability of existence at which an element is confirmed; it is published while the probability is above 0.5",
        kLive);
    visit("deletion_probability", self.deletion_probability, Bounds{0.0, 0.5}, "",
          "probability of existence below which an element is deleted", kLive);
    visit("max_position_sigma_m", self.max_position_sigma_m, Bounds{0.001, 1000.0}, "m",
          "maximum standard deviation of the position in any direction of a lost element that is published (circle "
          "paper, eq. 33)",
          kLive);
    visit("lost_position_sigma_m", self.lost_position_sigma_m, Bounds{0.001, 1000.0}, "m",
          "maximum standard deviation of the position in any direction of a lost element that is kept for "
          "re-identification");
    visit("max_unseen_s", self.max_unseen_s, Bounds{0.0, 1e6}, "s",
          "maximum time without a detection, after which an element is deleted", kLive);
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

}  // namespace situation_awareness
