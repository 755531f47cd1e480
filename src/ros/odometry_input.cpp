// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/odometry_input.hpp"

#include <algorithm>
#include <cstddef>
#include <exception>
#include <utility>

#include <geometry_msgs/TransformStamped.h>
#include <boost/make_shared.hpp>

#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/receipt.hpp"
#include "situation_awareness/ros/scan_check.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kNoOdometry = "no odometry";

}  // namespace

OdometryInput::OdometryInput(Context& context, const NodeletParams& params, const ScannerParams& scanner,
                             const OdometryFrames& frames, Use use)
    : context_(context),
      frames_(frames),
      world_frame_(params.world_frame),
      max_stamp_ahead_s_(params.max_stamp_ahead_s),
      use_(std::move(use)),
      scans_(context.node(),
             {params.deskew, params.tf_timeout_s, static_cast<std::size_t>(params.queue_size), params.max_stamp_ahead_s,
              scanner},
             {[this](const auto& reason, const auto& detail) { context_.drop(reason, detail); },
              [this] { return std::make_pair(std::string(kNoOdometry), why_unplaced()); }}),
      refusals_(context.name()) {
  scans_.set_base_frame(frames.base);
  context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report(status); });
  context.on_arrival([this](const auto& msg, const ros::SteadyTime& arrival) { take(msg, arrival); },
                     [this] { return scans_.waiting(); });
  context.when_made([this] {
    subscriber_.emplace(context_.node(), "odom",
                        [this](const nav_msgs::OdometryConstPtr& msg, const ros::SteadyTime&) { add(*msg); });
  });
  // Where the scanner is may be known after its scans, and waits end without odometry, too.
  release_waiting_ = context.poll([this] {
    release();
    return !scans_.is_empty();
  });
}

void OdometryInput::take(const sensor_msgs::LaserScanConstPtr& msg, const ros::SteadyTime& arrival) {
  if (scans_.add({msg, arrival}) == StampOrder::Verdict::kRestart) context_.drop_enqueued(drop_reason::kRestart);
  release_waiting_();
}

std::string OdometryInput::defect_of(const nav_msgs::Odometry& msg) const {
  const std::string defect = odometry_msg_defect(msg);
  if (!defect.empty()) return defect;
  const std::string of_frame = odometry_frame_defect(msg, frames_, subscriber_->subscriber().getTopic());
  if (!of_frame.empty()) return of_frame;
  return frames_.odom.empty() && tf2_frame(msg.header.frame_id) == world_frame_ ? "odometry in the world frame" : "";
}

void OdometryInput::add(const nav_msgs::Odometry& msg) {
  ++received_;
  try {
    const std::string defect = defect_of(msg);
    if (!defect.empty()) return refusals_.add(defect);
    if (is_ahead_of_clock(msg.header.stamp, max_stamp_ahead_s_)) return refusals_.add(drop_reason::kAheadOfClock);
    geometry_msgs::TransformStamped transform = transform_from_odometry(msg);
    const std::int64_t stamp_ns = to_nanoseconds(msg.header.stamp);
    const auto verdict = use_.add(stamp_ns, pose2_of(isometry_from_msg(transform.transform)), receipt_ns());
    if (verdict == OdometryTrack::Verdict::kRefused) return refusals_.add("odometry stamp repeats or goes back");
    if (frames_.odom.empty()) frames_.odom = tf2_frame(msg.header.frame_id);
    if (frames_.base.empty()) frames_.base = tf2_frame(msg.child_frame_id);
    scans_.set_base_frame(frames_.base);
    if (verdict == OdometryTrack::Verdict::kRestarted) scans_.forget_poses();
    scans_.add_pose(std::move(transform));
    latest_ns_ = stamp_ns;
    release();
  } catch (const std::exception& error) {
    refusals_.add(error.what());
  }
}

std::string OdometryInput::why_unplaced() const {
  if (frames_.base.empty()) return "there is none on the topic odom";
  return "the latest is of " + std::to_string(1e-9 * static_cast<double>(latest_ns_)) + " s";
}

// Enqueues the scans that have their poses. Does not throw.
void OdometryInput::release() {
  try {
    while (const std::optional<ScanOnBase> ready = scans_.next()) {
      OdometryPosedScan posed;
      posed.msg = ready->arrived.msg;
      posed.header = posed.msg->header;
      posed.T_odom_lidar = ready->T_odom_lidar;
      posed.T_odom_lidar_end = ready->T_odom_lidar_end;
      posed.T_odom_base = ready->T_odom_base;
      context_.enqueue(boost::make_shared<const OdometryPosedScan>(posed), ready->arrived.at);
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
  status.add("odometry received", received_);
  refusals_.report(status);
  reported_received_ = received_;
}

}  // namespace situation_awareness
