// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <tf2/buffer_core.h>
#include <Eigen/Geometry>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/even_stamps.hpp"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/pose/fix_consistency.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/pose/gps_ins_backlog.hpp"
#include "situation_awareness/pose/turn_consistency.hpp"
#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"

namespace situation_awareness {

/// The pose by GPS and INS from messages, live or of a bag. Where IMU and antenna are on the base is asked of TF until
/// it is known, and then taken for fixed; a frame that is the base needs no transform. Until both are known there is no
/// filter, and messages are not used.
class GpsInsInput {
 public:
  /// `transforms` must outlive this. Throws std::invalid_argument as the parameters' check.
  GpsInsInput(const GpsInsNodeletParams& params, const tf2::BufferCore& transforms);

  /// Reason why the sample was not used, one of a few texts; empty if it was. detail() tells more. `received_ns`, here
  /// and below, as StampOrder::judge.
  std::string add_imu(const sensor_msgs::Imu& msg, std::int64_t received_ns = StampOrder::kNone);
  const std::string& detail() const { return detail_; }

  /// Whether there is no filter since it is not known yet where a sensor is on the base.
  bool waits_for_sensors() const { return waits_for_sensors_; }

  /// Takes the antenna's frame from a fix that is added later.
  void see_fix(const sensor_msgs::NavSatFix& msg) { is_of(antenna_, msg.header.frame_id); }

  /// What is not used of these is counted by counters(), or by those of the filter. A covariance that is unknown or
  /// zero is replaced by `fix_sigma_m`. A fix without an altitude (not a number) is taken to be at the height of the
  /// one before, within 50 m.
  void add_fix(const sensor_msgs::NavSatFix& msg, std::int64_t received_ns = StampOrder::kNone);
  /// That of the latest add_fix, if it has a position and a covariance, and its stamp is in order.
  const std::optional<GeodeticFix>& good_fix() const { return good_fix_; }
  /// Where the antenna is on the base (m), once there is a filter.
  Eigen::Vector3d antenna_base_m() const { return antenna_.T_base_sensor->translation(); }

  /// The height (z) of the IMU in the world with its variance; the rest of the pose is not used. A pose and not a
  /// pressure: what a pressure of the air is in m above the origin changes with the weather by metres in an hour, which
  /// the driver that has a model of it must say in the variance.
  void add_altitude(const geometry_msgs::PoseWithCovarianceStamped& msg);

  /// The yaw of the orientation (of the message's frame in east, north, up: REP 145), its variance about z.
  void add_heading(const sensor_msgs::Imu& msg);

  /// Keeps what comes in before the pose is ready, the latest `duration_s`, for backlog_poses.
  void keep_backlog(double duration_s) { backlog_s_ = duration_s; }
  /// As GpsInsBacklog::take_poses; none without keep_backlog.
  std::vector<GpsInsPose> backlog_poses(const GpsInsPose& ready);

  /// Why there is no pose now, in one sentence; empty if there is.
  std::string why_not_ready() const;

  /// One sentence if what the IMU and the fixes measure, or their stamps, contradict each other, else empty.
  std::string contradiction() const;

  /// None before both mountings are known.
  GpsIns* filter() { return filter_ ? &*filter_ : nullptr; }
  const GpsIns* filter() const { return filter_ ? &*filter_ : nullptr; }

  const Counters& counters() const { return counters_; }
  /// Of the latest fix that a receiver had; StampOrder::kNone before.
  std::int64_t fix_stamp_ns() const { return fix_stamp_ns_; }

 private:
  struct Sensor {
    bool is_given = false;  ///< frame is a parameter's, whatever the messages say
    std::string frame;      ///< empty: not known yet
    std::optional<Eigen::Isometry3d> T_base_sensor;
  };

  /// Its stamp, or that by which it is spread over the time where stamps come in bunches.
  std::int64_t even_stamp_ns(const InertialSample& sample, std::int64_t received_ns);
  void complete(GeodeticFix& fix);
  std::string take_imu(const sensor_msgs::Imu& msg, std::int64_t received_ns);
  /// Whether its place on the base is known, now if not before; else why_not is tf2's reason.
  bool mount(Sensor& sensor, std::string& why_not) const;
  /// Whether the message is of the sensor's frame, which is that of the first message if it is not given.
  static bool is_of(Sensor& sensor, const std::string& frame);

  GpsInsNodeletParams params_;
  const tf2::BufferCore& transforms_;
  Sensor imu_, antenna_, compass_;
  std::optional<GpsIns> filter_;
  double backlog_s_ = 0.0;
  std::optional<GpsInsBacklog> backlog_;
  bool waits_for_sensors_ = false;
  StampOrder fixes_;
  EvenStamps even_stamps_;
  std::optional<InertialSample> sample_;  ///< the latest, as it came
  TurnConsistency turns_;
  FixConsistency consistency_;
  std::optional<double> altitude_m_;  ///< of the latest fix with one
  Counters counters_;
  std::string detail_;
  std::string refusal_;  ///< of the latest sample
  std::optional<GeodeticFix> good_fix_;
  std::int64_t fix_stamp_ns_ = StampOrder::kNone;
  std::int64_t heading_stamp_ns_ = StampOrder::kNone;
};

/// Keeps the first sentence of GpsInsInput::contradiction, or one that names a cause in the place of one that does not.
void keep_contradiction(std::string& kept, const std::string& now);

}  // namespace situation_awareness
