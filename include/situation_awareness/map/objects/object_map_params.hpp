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
          "weight of a detection with an occluded end in the update of the probability of existence, of at least 10 "
          "scans per second");
    visit("max_part_radius_m", self.max_part_radius_m, Bounds{0.0, 10.0}, "m",
          "maximum mean radius of an element that may be part of a body (a limb)");
    visit("max_part_gap_m", self.max_part_gap_m, Bounds{0.0, 10.0}, "m", "maximum gap between a part and its body");
    visit("min_part_travel_m", self.min_part_travel_m, Bounds{0.01, 100.0}, "m",
          "distance that two elements must move together to become one body");
    visit("max_position_sigma_m", self.max_position_sigma_m, Bounds{0.001, 1000.0}, "m",
          "maximum standard deviation of the position in any direction of a lost element that is published (circle "
          "paper, eq. 33)",
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

}  // namespace situation_awareness
