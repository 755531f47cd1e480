// SPDX-License-Identifier: BSD-3-Clause
// points, TF world -> sensor  ->  scan, TF world -> SENSOR_level
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <geometry_msgs/TransformStamped.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_ros/transform_broadcaster.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/ros/convert/cloud.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/params/object_nodelet_params.hpp"
#include "situation_awareness/ros/posed_input.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/scan/cloud_slice.hpp"

namespace situation_awareness {

class SlicingStage {
 public:
  using Input = PosedInput<sensor_msgs::PointCloud2>;
  using Context = Input::Context;
  static constexpr const char* kInput = "points";
  static constexpr auto kReadParams = read_object_nodelet_params;

  SlicingStage(Context& context, const ObjectNodeletParams& params)
      : context_(context),
        params_(params.nodelet),
        pose_offset_s_(params.pipeline.scan_pose_offset_s),
        publisher_(context.node().advertise<sensor_msgs::LaserScan>("scan", 20)),
        input_(context, params.nodelet, pose_offset_s_,
               {cloud_msg_defect,
                [this](const sensor_msgs::PointCloud2& msg) { return taken(msg, remember(msg), params_.deskew); },
                [] {}}) {
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report(status); });
    context.serve_live([this](const CloudSliceParams& cloud) { cloud_ = cloud; }, params.pipeline.cloud);
  }
  SlicingStage(const SlicingStage&) = delete;
  SlicingStage& operator=(const SlicingStage&) = delete;

  bool process(const PosedMessage<sensor_msgs::PointCloud2>& posed) {
    slice_ = slice_cloud(cloud_from_msg(*posed.msg, times_of(*posed.msg)), posed.T_world_sensor,
                         posed.T_world_sensor_end, cloud_, std::move(slice_));
    if (!slice_.times_valid) context_.diagnostics().counted({{"times of points ignored", 1}});
    if (slice_.untimed_returns > 0) {
      context_.diagnostics().counted({{"dropped points without a time", slice_.untimed_returns}});
    }
    are_times_ignored_ = are_times_ignored_ || !slice_.times_valid;
    if (untimed_.add(slice_, posed.T_world_sensor, cloud_)) is_untimed_ = true;

    const std::string level_frame = tf2_frame(posed.header.frame_id) + "_level";
    const Scan& scan = slice_.scan;
    const double duration_s = static_cast<double>(scan.beams.size() - 1) * scan.time_increment_s;
    const sensor_msgs::LaserScan msg =
        scan_to_msg(scan, level_frame, cloud_.min_range_m, cloud_.max_range_m, duration_s);
    publish_level_frame(msg);
    context_.publish(publisher_, msg);
    return true;
  }

 private:
  /// What the times of a cloud mean is found out when it arrives, in order; it is used once its poses are known.
  const CloudMsgTimes& remember(const sensor_msgs::PointCloud2& msg) {
    if (waiting_.size() > kMostWaiting) waiting_.clear();  // those that were dropped
    return waiting_[to_nanoseconds(msg.header.stamp)] = cloud_msg_times(msg, times_);
  }

  CloudMsgTimes times_of(const sensor_msgs::PointCloud2& msg) {
    const auto it = waiting_.find(to_nanoseconds(msg.header.stamp));
    if (it == waiting_.end()) return {};
    const CloudMsgTimes times = it->second;
    waiting_.erase(it);
    return times;
  }

  void report(StageDiagnostics::Status& status) {
    using diagnostic_msgs::DiagnosticStatus;
    if (std::exchange(are_times_ignored_, false)) {
      status.mergeSummary(DiagnosticStatus::WARN, "times of points cannot be used: all are put where the first was");
    }
    if (std::exchange(is_untimed_, false)) {
      status.mergeSummary(DiagnosticStatus::WARN, "points have no times, but the sensor moves while it sweeps");
    }
    if (untimed_.clouds() > 0) status.addf("moved in a sweep without times [m]", "%.2f", untimed_.most_m());
  }

  /// It stands still during the scan: the motion has been taken out. Segmentation looks up its pose as that of any
  /// scan.
  void publish_level_frame(const sensor_msgs::LaserScan& scan) {
    const auto at = [&](const ros::Time& time) {
      return transform_to_msg(slice_.T_world_level, to_nanoseconds(time), params_.world_frame, scan.header.frame_id);
    };
    const Taken posed = later(taken(scan), pose_offset_s_);
    std::vector<geometry_msgs::TransformStamped> transforms{at(posed.first)};
    if (posed.last != posed.first) transforms.push_back(at(posed.last));
    transforms_.sendTransform(transforms);
  }

  static constexpr std::size_t kMostWaiting = 2000;  ///< more than any queue has
  Context& context_;
  NodeletParams params_;
  CloudTimeReader times_;
  std::map<std::int64_t, CloudMsgTimes> waiting_;  ///< by stamp
  UntimedMotion untimed_;
  bool are_times_ignored_ = false, is_untimed_ = false;  ///< since the latest report
  double pose_offset_s_;
  CloudSliceParams cloud_;
  CloudSlice slice_;
  ros::Publisher publisher_;
  tf2_ros::TransformBroadcaster transforms_;
  Input input_;
};

using SlicingNodelet = StageNodelet<SlicingStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::SlicingNodelet, nodelet::Nodelet)
