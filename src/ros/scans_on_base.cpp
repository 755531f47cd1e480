// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/scans_on_base.hpp"

#include <utility>

#include <ros/transport_hints.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/receipt.hpp"
#include "situation_awareness/ros/scan_check.hpp"

namespace situation_awareness {
namespace {

// Frames of the buffer of poses, whatever they are called in TF.
constexpr const char* kOdom = "odom";
constexpr const char* kBase = "base";
constexpr const char* kOnBase = "lidar";

}  // namespace

ScansOnBase::ScansOnBase(ros::NodeHandle& node, const Params& params, Use use)
    : params_(params),
      use_(std::move(use)),
      tf_(transform_cache_time(params.timeout_s)),
      poses_(transform_cache_time(params.timeout_s)),
      queue_(poses_, {kOdom, params.timeout_s, params.max_waiting, 0.0},
             [this](const std::string& reason, const std::string& detail) { dropped(reason, detail); }),
      transform_input_(tf_, node) {}

void ScansOnBase::dropped(const std::string& reason, const std::string& detail) {
  if (reason != drop_reason::kNoTransform) return use_.drop(reason, detail);
  if (mounted_.empty() && !base_frame_.empty()) return use_.drop(reason, why_not_mounted_);
  const auto [no_pose, why] = use_.no_pose();
  use_.drop(no_pose, why);
}

StampOrder::Verdict ScansOnBase::add(const ArrivedScan& arrived) {
  const ArrivedScan scan{conventional(arrived.msg, params_.scanner), arrived.at};
  const std::string defect = scan_msg_defect(*scan.msg);
  if (!defect.empty()) {
    use_.drop(defect, "");
    return StampOrder::Verdict::kRefused;
  }
  if (is_ahead_of_clock(scan.msg->header.stamp, params_.max_stamp_ahead_s)) {
    use_.drop(drop_reason::kAheadOfClock, "");
    return StampOrder::Verdict::kRefused;
  }
  Taken taken = situation_awareness::taken(*scan.msg, params_.deskew);
  if (taken.frame != lidar_frame_) mounted_.clear();
  lidar_frame_ = std::exchange(taken.frame, kOnBase);
  const StampOrder::Verdict verdict = queue_.add(scan, taken, steady_now_ns(), receipt_ns());
  if (verdict == StampOrder::Verdict::kRestart) mounted_.clear();
  mount();  // it may have changed
  return verdict;
}

// Where the lidar is on the base, as TF knows it now.
void ScansOnBase::mount() {
  if (base_frame_.empty() || lidar_frame_.empty()) return;
  const std::string why_not = situation_awareness::mount(tf_, base_frame_, lidar_frame_, poses_, kBase, kOnBase);
  if (!why_not.empty()) {
    why_not_mounted_ = why_not;
  } else {
    mounted_ = lidar_frame_;
  }
}

void ScansOnBase::add_pose(geometry_msgs::TransformStamped T_odom_base) {
  T_odom_base.header.frame_id = kOdom;
  T_odom_base.child_frame_id = kBase;
  poses_.setTransform(T_odom_base, "poses");
}

void ScansOnBase::forget_poses() {
  poses_.clear();  // what is later would block them
  mounted_.clear();
}

std::optional<ScanOnBase> ScansOnBase::next() {
  if (mounted_.empty()) mount();
  queue_.receive(steady_now_ns(), receipt_ns());
  const std::optional<Posed<ArrivedScan>> ready = queue_.next(steady_now_ns());
  if (!ready) return std::nullopt;
  return ScanOnBase{ready->item, ready->T_world_sensor, ready->T_world_sensor_end,
                    transform_at(poses_, kOdom, kBase, ready->item.msg->header.stamp)};
}

}  // namespace situation_awareness
