// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/gps_ins_input.hpp"

#include <algorithm>
#include <cmath>
#include <exception>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/pose/local_world.hpp"
#include "situation_awareness/ros/convert/navigation_sensors.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/transform_queue.hpp"

namespace situation_awareness {
namespace {

/// Of the standard deviation of up to that of east and of north: satellites are never below the antenna.
constexpr double kVerticalRatio = 2.0;
/// m. Standard deviation of the altitude of a fix that has none: receivers hold the one before, and roads climb.
constexpr double kNoAltitudeSigma_m = 50.0;
/// Beyond what sensors of vehicles measure (200 g, 4000 deg/s) by far.
constexpr double kMaxForce_m_s2 = 1e4;
constexpr double kMaxRate_rad_s = 1e3;
/// The yaw of an axis that is nearer to the vertical than 6 degrees says nothing.
constexpr double kMinHorizontal = 0.1;
/// Orientations that follow the one used before by less are passed over: those of a compass all have the error of its
/// place. No source is recorded, and its sensitivity was not measured.
constexpr double kHeadingPeriod_s = 1.0;
/// The filter's reason.
constexpr const char* kAnotherTime = "imu of another time";
/// Index of the variance of z, and of the rotation about z, in the covariances of the messages.
constexpr std::size_t kHeight = 14, kYaw = 8;

}  // namespace

GpsInsInput::GpsInsInput(const GpsInsNodeletParams& params, const tf2::BufferCore& transforms)
    : params_(params), transforms_(transforms) {
  params.gps_ins.validate();
  imu_ = {!params.imu_frame.empty(), params.imu_frame, {}};
  antenna_ = {!params.fix_frame.empty(), params.fix_frame, {}};
  counters_.reset();
}

bool GpsInsInput::mount(Sensor& sensor, std::string& why_not) const {
  if (sensor.T_base_sensor) return true;
  if (sensor.frame == params_.base_frame) {
    sensor.T_base_sensor = Eigen::Isometry3d::Identity();
    return true;
  }
  try {
    if (transforms_.canTransform(params_.base_frame, sensor.frame, ros::Time(), &why_not)) {
      sensor.T_base_sensor = transform_at(transforms_, params_.base_frame, sensor.frame, ros::Time());
      return true;
    }
  } catch (const std::exception& error) {  // of tf2, or not a rotation
    why_not = error.what();
  }
  why_not = "from " + params_.base_frame + " to " + sensor.frame + ": " + why_not;
  return false;
}

bool GpsInsInput::is_of(Sensor& sensor, const std::string& frame) {
  if (sensor.is_given) return true;
  const std::string of = tf2_frame(frame);
  if (sensor.frame.empty()) sensor.frame = of;
  return !of.empty() && of == sensor.frame;
}

std::string GpsInsInput::add_imu(const sensor_msgs::Imu& msg, std::int64_t received_ns) {
  detail_.clear();
  std::string reason = take_imu(msg, received_ns);
  refusal_ = reason;
  return reason;
}

std::string GpsInsInput::why_not_ready() const {
  if (!filter_) {
    if (refusal_.empty()) return "there is no sample of the IMU";
    return detail_.empty() ? refusal_ : refusal_ + " " + detail_;
  }
  std::string why = filter_->reason();
  if (why.empty()) return why;
  if (!refusal_.empty()) why += ", the latest sample was dropped: " + refusal_;
  for (const Counters* const counters : {&counters_, &filter_->counters()}) {
    for (const auto& [reason, count] : *counters) {
      const bool is_of_fix = reason.rfind("fix", 0) == 0 || reason.rfind("no fix", 0) == 0;
      const bool is_used = reason.find(" used") != std::string::npos;
      if (is_of_fix && !is_used) why += ", " + std::to_string(count) + " dropped: " + reason;
    }
  }
  return why;
}

void keep_contradiction(std::string& kept, const std::string& now) {
  if (!now.empty() && (kept.empty() || kept == GpsIns::kContradicted)) kept = now;
}

std::string GpsInsInput::contradiction() const {
  for (const std::string& text : {consistency_.contradiction(params_.gps_ins.max_delay_s), turns_.contradiction(),
                                  filter_ ? filter_->contradiction() : std::string()}) {
    if (!text.empty()) return text;
  }
  if (!even_stamps_.is_bunched() || even_stamps_.is_spread()) return "";
  return "the samples of the IMU have the same stamp many at a time, and come at no steady rate: each must have its "
         "own";
}

std::int64_t GpsInsInput::even_stamp_ns(const InertialSample& sample, std::int64_t received_ns) {
  const bool is_repeated = sample_ && sample.stamp_ns == sample_->stamp_ns &&
                           sample.specific_force_m_s2 == sample_->specific_force_m_s2 &&
                           sample.angular_velocity_rad_s == sample_->angular_velocity_rad_s;
  if (is_repeated) return sample.stamp_ns;
  sample_ = sample;
  const std::int64_t stamp_ns = even_stamps_.add(sample.stamp_ns, received_ns);
  if (even_stamps_.is_spread()) ++counters_["imu stamped in bunches: spread"];
  return stamp_ns;
}

std::string GpsInsInput::take_imu(const sensor_msgs::Imu& msg, std::int64_t received_ns) {
  waits_for_sensors_ = false;
  InertialSample sample = inertial_sample_from_msg(msg);
  if (sample.stamp_ns == 0) return "bad imu: stamp of zero";
  if (!sample.specific_force_m_s2.allFinite() || !sample.angular_velocity_rad_s.allFinite()) {
    return "bad imu: not finite";
  }
  if (sample.specific_force_m_s2.norm() > kMaxForce_m_s2 || sample.angular_velocity_rad_s.norm() > kMaxRate_rad_s) {
    return "bad imu: out of range";
  }
  if (!is_of(imu_, msg.header.frame_id)) {
    return msg.header.frame_id.empty() ? "bad imu: no frame" : "bad imu: another frame";
  }
  if (!filter_) {
    waits_for_sensors_ = true;
    if (!mount(imu_, detail_)) return drop_reason::kNoTransform;
    if (antenna_.frame.empty()) return "no fix yet";
    if (!mount(antenna_, detail_)) return drop_reason::kNoTransform;
    std::optional<GeodeticPosition> origin;
    waits_for_sensors_ = false;
    if (!params_.origin.empty()) origin = parse_geodetic_position(params_.origin, "origin");
    const GpsInsMounting mounting{*imu_.T_base_sensor, antenna_.T_base_sensor->translation()};
    filter_.emplace(params_.gps_ins, mounting, origin);
    if (backlog_s_ > 0.0) backlog_.emplace(params_.gps_ins, mounting, backlog_s_);
  }
  sample.stamp_ns = even_stamp_ns(sample, received_ns);
  consistency_.add_imu(sample.stamp_ns, received_ns);
  const std::int64_t before_ns = filter_->stamp_ns();
  const std::uint64_t doubted_before = filter_->counters().of(kAnotherTime);
  filter_->add_imu(sample, received_ns);
  const std::int64_t after_ns = filter_->stamp_ns();
  if (after_ns == before_ns || after_ns != sample.stamp_ns) {
    return filter_->counters().of(kAnotherTime) > doubted_before ? drop_reason::kAnotherTime : drop_reason::kStamp;
  }
  if (after_ns < before_ns) fixes_.reset();  // of another time, too
  turns_.add_rate(sample.stamp_ns, imu_.T_base_sensor->linear().row(2).dot(sample.angular_velocity_rad_s));
  if (backlog_ && !filter_->is_ready()) backlog_->add_imu(sample);
  return "";
}

/// Gives a fix the covariance and the altitude that it lacks.
void GpsInsInput::complete(GeodeticFix& fix) {
  Eigen::Matrix3d& covariance = fix.covariance_m2;
  double& altitude_m = fix.position.altitude_m;
  const bool has_altitude = !std::isnan(altitude_m);
  if (has_altitude) {
    altitude_m_ = altitude_m;
  } else {
    // An origin by a fix without one is on the ellipsoid.
    fix.has_altitude = false;
    altitude_m = altitude_m_.value_or(filter_->origin() ? filter_->origin()->altitude_m : 0.0);
    covariance.row(2).setZero();
    covariance.col(2).setZero();
    covariance(2, 2) = kNoAltitudeSigma_m * kNoAltitudeSigma_m;
    ++counters_["fix without altitude: used in x and y"];
  }
  if (!covariance.allFinite() || covariance.diagonal().minCoeff() > 0.0) return;
  const double variance_m2 = params_.fix_sigma_m * params_.fix_sigma_m;
  const double up_m2 = has_altitude ? kVerticalRatio * kVerticalRatio * variance_m2 : covariance(2, 2);
  covariance = Eigen::Vector3d(variance_m2, variance_m2, up_m2).asDiagonal();
  ++counters_["fix without covariance: fix_sigma_m used"];
}

void GpsInsInput::add_fix(const sensor_msgs::NavSatFix& msg, std::int64_t received_ns) {
  good_fix_.reset();
  if (!is_of(antenna_, msg.header.frame_id)) {
    ++counters_[msg.header.frame_id.empty() ? "fix without a frame" : "fix in another frame"];
    return;
  }
  GeodeticFix fix = fix_from_msg(msg);
  if (!filter_) {
    ++counters_["fix before the imu"];
    return;
  }
  consistency_.add_fix(fix.stamp_ns, received_ns);
  if (fix.is_fix) complete(fix);
  // One that is far from the samples is refused by the filter, and only what is used is judged.
  const double off_s = std::abs(seconds_between(fix.stamp_ns, filter_->stamp_ns()));
  const bool is_good = fix.is_fix && is_valid(fix.position) && off_s <= params_.gps_ins.max_delay_s;
  if (is_good && fixes_.judge(fix.stamp_ns, received_ns) == StampOrder::Verdict::kRefused) {
    ++counters_[fixes_.doubted() > 0 ? "fix of another time" : "fix out of order"];
    return;
  }
  if (is_good) fix_stamp_ns_ = fix.stamp_ns;
  filter_->add_fix(fix);
  if (backlog_ && !filter_->is_ready()) backlog_->add_fix(fix);
  if (!is_good || !fix.covariance_m2.allFinite()) return;
  good_fix_ = fix;
  if (fix.has_altitude) {
    consistency_.add_altitude(fix.stamp_ns, fix.position.altitude_m, std::sqrt(fix.covariance_m2(2, 2)));
  }
  if (!filter_->origin()) return;
  turns_.add_fix(fix.stamp_ns, local_position(*filter_->origin(), fix.position).head<2>(),
                 std::sqrt(fix.covariance_m2.diagonal().head<2>().maxCoeff()));
}

std::vector<GpsInsPose> GpsInsInput::backlog_poses(const GpsInsPose& ready) {
  if (!backlog_ || !filter_->origin()) return {};
  return backlog_->take_poses(ready, *filter_->origin());
}

void GpsInsInput::add_altitude(const geometry_msgs::PoseWithCovarianceStamped& msg) {
  const double variance_m2 = msg.pose.covariance[kHeight];
  if (tf2_frame(msg.header.frame_id) != params_.nodelet.world_frame) {
    ++counters_["altitude in another frame"];
  } else if (!(variance_m2 > 0.0)) {
    ++counters_["altitude without a variance"];
  } else if (!filter_) {
    ++counters_["altitude before the imu"];
  } else {
    filter_->add_altitude(to_nanoseconds(msg.header.stamp), msg.pose.pose.position.z, std::sqrt(variance_m2));
  }
}

void GpsInsInput::add_heading(const sensor_msgs::Imu& msg) {
  const std::int64_t stamp_ns = to_nanoseconds(msg.header.stamp);
  if (!filter_) {
    ++counters_["heading before the imu"];
    return;
  }
  // A stamp that went back is of a time that started again.
  if (heading_stamp_ns_ != StampOrder::kNone && stamp_ns >= heading_stamp_ns_ &&
      seconds_between(heading_stamp_ns_, stamp_ns) < kHeadingPeriod_s) {
    return;
  }
  if (msg.orientation_covariance[0] == -1.0) {  // as sensor_msgs/Imu says
    ++counters_["heading without an orientation"];
    return;
  }
  if (!is_of(compass_, msg.header.frame_id)) {
    ++counters_[msg.header.frame_id.empty() ? "heading without a frame" : "heading in another frame"];
    return;
  }
  std::string why_not;
  if (!mount(compass_, why_not)) {
    ++counters_["heading without a transform"];
    return;
  }
  geometry_msgs::Transform orientation;
  orientation.rotation = msg.orientation;
  Eigen::Matrix3d R;
  try {
    R = isometry_from_msg(orientation).linear() * compass_.T_base_sensor->linear().transpose();
  } catch (const std::exception&) {
    ++counters_["heading not a rotation"];
    return;
  }
  if (R.block<2, 1>(0, 0).norm() < kMinHorizontal) {
    ++counters_["heading of an upright base"];
    return;
  }
  heading_stamp_ns_ = stamp_ns;
  const double variance = std::max(msg.orientation_covariance[kYaw], 0.0);
  filter_->add_heading(stamp_ns, std::atan2(R(1, 0), R(0, 0)) + params_.heading_offset_rad,
                       std::sqrt(variance + params_.heading_sigma_rad * params_.heading_sigma_rad));
}

}  // namespace situation_awareness
