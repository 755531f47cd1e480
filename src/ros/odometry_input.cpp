// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/odometry_input.hpp"

#include <algorithm>
#include <cstddef>
#include <exception>
#include <utility>

#include <geometry_msgs/TransformStamped.h>
#include <ros/console.h>
#include <ros/transport_hints.h>
#include <boost/make_shared.hpp>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/scan_check.hpp"

namespace situation_awareness {
namespace {

// Frames of the buffer of odometry, whatever they are called in TF.
constexpr const char* kOdometry = "odometry";
constexpr const char* kOdometryBase = "base";
constexpr const char* kOnBase = "lidar";
constexpr const char* kNoOdometry = "no odometry";

}  // namespace

OdometryInput::OdometryInput(Context& context, const NodeletParams& params, const OdometryFrames& frames,
                             double reset_time_jump_s, Use use)
    : context_(context),
      frames_(frames),
      world_frame_(params.world_frame),
      deskew_(params.deskew),
      use_(std::move(use)),
      tf_(transform_cache_time(params.tf_timeout_s)),
      odometry_(transform_cache_time(params.tf_timeout_s)),
      queue_(odometry_,
             {kOdometry, params.tf_timeout_s, static_cast<std::size_t>(params.queue_size), reset_time_jump_s, 0.0},
             [this](const std::string& reason, const std::string& detail) {
               if (reason != drop_reason::kNoTransform) {
                 context_.drop(reason, detail);
               } else if (mounted_.empty() && !frames_.base.empty()) {
                 context_.drop(reason, why_not_mounted_);
               } else {
                 context_.drop(kNoOdometry, why_unplaced());
               }
             }),
      listener_(tf_, context.node(), true, ros::TransportHints().tcpNoDelay()) {  // on its own thread
  refused_.reset();
  context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report(status); });
  context.on_arrival([this](const auto& msg, const ros::SteadyTime& arrival) { take(msg, arrival); },
                     [this] { return queue_.waiting(); });
  context.when_made([this] {
    subscriber_.emplace(context_.node(), use_.topic,
                        [this](const nav_msgs::OdometryConstPtr& msg, const ros::SteadyTime&) { add(*msg); });
  });
  // Where the scanner is may be known after its scans, and waits end without odometry, too.
  context.every(0.005, [this] { release(); });
}

void OdometryInput::take(const sensor_msgs::LaserScanConstPtr& msg, const ros::SteadyTime& arrival) {
  const std::string defect = scan_msg_defect(*msg);
  if (!defect.empty()) return context_.diagnostics().dropped(defect);
  Taken taken = situation_awareness::taken(*msg, deskew_);
  if (taken.frame != lidar_frame_) mounted_.clear();
  lidar_frame_ = std::exchange(taken.frame, kOnBase);
  if (queue_.add({msg, arrival}, taken, steady_now_ns()) == StampOrder::Verdict::kRestart) {
    context_.drop_enqueued(drop_reason::kRestart);
    mounted_.clear();
  }
  mount();  // it may have changed
  release();
}

// Where the lidar is on the base, as TF knows it now.
void OdometryInput::mount() {
  if (frames_.base.empty() || lidar_frame_.empty()) return;
  if (!tf_.canTransform(frames_.base, lidar_frame_, ros::Time(), &why_not_mounted_)) {
    why_not_mounted_ = "from " + frames_.base + " to " + lidar_frame_ + ": " + why_not_mounted_;
    return;
  }
  try {
    geometry_msgs::TransformStamped transform = tf_.lookupTransform(frames_.base, lidar_frame_, ros::Time());
    isometry_from_msg(transform.transform);  // checks it
    transform.header.frame_id = kOdometryBase;
    transform.child_frame_id = kOnBase;
    odometry_.setTransform(transform, "TF", true);
    mounted_ = lidar_frame_;
  } catch (const std::exception& error) {
    why_not_mounted_ = error.what();
  }
}

std::string OdometryInput::defect_of(const nav_msgs::Odometry& msg) const {
  std::string defect = odometry_msg_defect(msg);
  if (!defect.empty()) return defect;
  const std::string odom = tf2_frame(msg.header.frame_id), base = tf2_frame(msg.child_frame_id);
  if ((frames_.odom.empty() && odom.empty()) || (frames_.base.empty() && base.empty())) {
    return "odometry without a frame";
  }
  if (frames_.odom.empty() && odom == world_frame_) return "odometry in the world frame";
  const auto is_other = [](const std::string& frame, const std::string& known) {
    return !known.empty() && !frame.empty() && frame != known;
  };
  return is_other(odom, frames_.odom) || is_other(base, frames_.base) ? "odometry in another frame" : "";
}

void OdometryInput::refuse(const std::string& reason) {
  ++refused_[reason];
  ++refusals_;
  latest_refusal_ = reason;
  ROS_WARN_STREAM_THROTTLE(5.0, context_.name() << ": not used, " << reason);
}

void OdometryInput::add(const nav_msgs::Odometry& msg) {
  ++received_;
  try {
    const std::string defect = defect_of(msg);
    if (!defect.empty()) return refuse(defect);
    geometry_msgs::TransformStamped transform = transform_from_odometry(msg);
    const std::int64_t stamp_ns = to_nanoseconds(msg.header.stamp);
    const auto verdict = use_.add(msg, transform);
    if (verdict == OdometryTrack::Verdict::kRefused) return refuse("odometry stamp repeats or goes back");
    if (frames_.odom.empty()) frames_.odom = tf2_frame(msg.header.frame_id);
    if (frames_.base.empty()) frames_.base = tf2_frame(msg.child_frame_id);
    if (verdict == OdometryTrack::Verdict::kRestarted) {
      odometry_.clear();  // what is later would block it
      mounted_.clear();
    }
    transform.header.frame_id = kOdometry;
    transform.child_frame_id = kOdometryBase;
    odometry_.setTransform(transform, use_.topic);
    latest_ns_ = stamp_ns;
    release();
  } catch (const std::exception& error) {
    refuse(error.what());
  }
}

std::string OdometryInput::why_unplaced() const {
  if (frames_.base.empty()) return std::string("there is none on the topic ") + use_.topic;
  return "the latest is of " + std::to_string(1e-9 * static_cast<double>(latest_ns_)) + " s";
}

// Enqueues the scans that have their poses. Does not throw.
void OdometryInput::release() {
  try {
    if (mounted_.empty()) mount();
    while (const std::optional<Posed<Arrived>> ready = queue_.next(steady_now_ns())) {
      OdometryPosedScan posed;
      posed.msg = ready->item.msg;
      posed.header = posed.msg->header;
      posed.T_odom_lidar = ready->T_world_sensor;
      posed.T_odom_lidar_end = ready->T_world_sensor_end;
      posed.T_odom_base = transform_at(odometry_, kOdometry, kOdometryBase, posed.header.stamp);
      context_.enqueue(boost::make_shared<const OdometryPosedScan>(posed), ready->item.at);
    }
  } catch (const std::exception& error) {
    context_.drop(drop_reason::kError, error.what());
  }
}

void OdometryInput::report(StageDiagnostics::Status& status) {
  using diagnostic_msgs::DiagnosticStatus;
  if (received_ == reported_received_ && subscriber_) {
    status.mergeSummary(DiagnosticStatus::WARN, "no odometry on " + subscriber_->subscriber().getTopic());
  }
  if (refusals_ > reported_refusals_) status.mergeSummary(DiagnosticStatus::WARN, "not used: " + latest_refusal_);
  status.add("odometry received", received_);
  for (const auto& [reason, count] : refused_) status.add("not used: " + reason, count);
  reported_received_ = received_;
  reported_refusals_ = refusals_;
}

}  // namespace situation_awareness
