// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/inertial_input.hpp"

#include <algorithm>
#include <cstddef>
#include <exception>

#include <boost/make_shared.hpp>

#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/receipt.hpp"
#include "situation_awareness/ros/scan_check.hpp"

namespace situation_awareness {
namespace {

/// Scans that wait, at least: of 30 s at 60 Hz. At 1081 beams with intensities these are 18 MB.
constexpr std::size_t kLeastWaiting = 2000;

ScansOnBase::Params scans_params(const NodeletParams& params, const ScannerParams& scanner) {
  return {params.deskew, std::max(params.tf_timeout_s, InertialNavigation::kBacklog_s),
          std::max(static_cast<std::size_t>(params.queue_size), kLeastWaiting), params.max_stamp_ahead_s, scanner};
}

}  // namespace

InertialInput::InertialInput(Context& context, const GpsInsNodeletParams& params, const ScannerParams& scanner)
    : context_(context),
      max_stamp_ahead_s_(params.nodelet.max_stamp_ahead_s),
      scans_(context.node(), scans_params(params.nodelet, scanner),
             {[this](const auto& reason, const auto& detail) { context_.drop(reason, detail); },
              [this] { return why_no_pose(); }}),
      navigation_(params, scans_.tf(),
                  {[this](const auto& T_odom_base) { scans_.add_pose(T_odom_base); },
                   [this] {
                     release();
                     scans_.forget_poses();
                   }}),
      report_(context.name(), navigation_.input()),
      refusals_(context.name()) {
  scans_.set_base_frame(params.base_frame);
  context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report(status); });
  context.on_arrival([this](const auto& msg, const ros::SteadyTime& arrival) { take(msg, arrival); },
                     [this] { return scans_.waiting(); });
  context.when_made([this] {
    imu_.emplace(context_.node(), "imu", [this](const auto& msg, const ros::SteadyTime&) { add(*msg); });
    fix_.emplace(context_.node(), "fix", [this](const auto& msg, const ros::SteadyTime&) { add(*msg); });
  });
  // Where the scanner is may be known after its scans, and waits end without samples, too.
  release_waiting_ = context.poll([this] {
    release();
    return !scans_.is_empty();
  });
}

void InertialInput::take(const sensor_msgs::LaserScanConstPtr& msg, const ros::SteadyTime& arrival) {
  if (scans_.add({msg, arrival}) == StampOrder::Verdict::kRestart) context_.drop_enqueued(drop_reason::kRestart);
  release_waiting_();
}

void InertialInput::add(const sensor_msgs::Imu& msg) {
  ++received_;
  try {
    if (is_ahead_of_clock(msg.header.stamp, max_stamp_ahead_s_)) {
      return refusals_.add(std::string("imu: ") + drop_reason::kAheadOfClock);
    }
    const std::string reason = navigation_.add_imu(msg, receipt_ns());
    report_.add();
    if (!reason.empty()) refusals_.add(reason, navigation_.input().detail());
    release();
  } catch (const std::exception& error) {
    refusals_.add("imu: error", error.what());
  }
}

void InertialInput::add(const sensor_msgs::NavSatFix& msg) {
  ++fixes_received_;
  try {
    if (is_ahead_of_clock(msg.header.stamp, max_stamp_ahead_s_)) {
      return refusals_.add(std::string("fix: ") + drop_reason::kAheadOfClock);
    }
    navigation_.add_fix(msg, receipt_ns());
  } catch (const std::exception& error) {
    refusals_.add("fix: error", error.what());
  }
}

std::pair<std::string, std::string> InertialInput::why_no_pose() const {
  if (navigation_.is_ready()) {
    return {"no pose", "the latest is of " + std::to_string(to_ros_time(navigation_.stamp_ns()).toSec()) + " s"};
  }
  return {"pose not ready", navigation_.input().why_not_ready()};
}

// Passes on the scans that have their poses. Does not throw.
void InertialInput::release() {
  try {
    while (const std::optional<ScanOnBase> ready = scans_.next()) {
      const auto scan = boost::make_shared<InertialScan>();
      scan->msg = ready->arrived.msg;
      scan->header = scan->msg->header;
      scan->T_odom_lidar = ready->T_odom_lidar;
      scan->T_odom_lidar_end = ready->T_odom_lidar_end;
      const std::int64_t stamp_ns = to_nanoseconds(scan->header.stamp);
      scan->placement = navigation_.placement_at(stamp_ns, ready->T_odom_base, ready->T_odom_lidar);
      if (navigation_.was_ready_at(stamp_ns)) {
        context_.enqueue(scan, ready->arrived.at);
      } else {
        context_.handle_now(scan, ready->arrived.at);
      }
    }
  } catch (const std::exception& error) {
    context_.drop(drop_reason::kError, error.what());
  }
}

void InertialInput::report(StageDiagnostics::Status& status) {
  using diagnostic_msgs::DiagnosticStatus;
  if (received_ == reported_received_ && imu_) {
    status.mergeSummary(DiagnosticStatus::WARN, "no samples on " + imu_->subscriber().getTopic());
  }
  if (!navigation_.is_ready()) {
    status.mergeSummary(DiagnosticStatus::WARN, "pose not ready: " + navigation_.input().why_not_ready());
  }
  status.add("samples received", received_);
  status.add("fixes received", fixes_received_);
  refusals_.report(status);
  status.add("fixes later than their patience", navigation_.late_fixes());
  report_.report(status);
  reported_received_ = received_;
}

}  // namespace situation_awareness
