// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/scans.hpp"

#include <utility>
#include <vector>

#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>

#include "command_line.hpp"
#include "situation_awareness/common/format.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/ros/convert/cloud.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/pose_offset_report.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/transform_queue.hpp"

namespace situation_awareness {
namespace {

/// The check of a scanner, by scans that were used.
struct CheckedScanner {
  explicit CheckedScanner(const RangeLimiterParams& of, double used_offset_s)
      : params(of), check(of.scanner, used_offset_s) {}

  void add(const Scan& scan, const Eigen::Isometry3d& T_world_lidar, const Eigen::Isometry3d& T_world_lidar_end) {
    limited = limit_range(scan, T_world_lidar, params, std::move(limited));
    points = project_horizontally(limited, T_world_lidar, T_world_lidar_end, std::move(points));
    check.add(limited, points, T_world_lidar, T_world_lidar_end);
  }

  std::vector<std::string> advice() const {
    std::vector<std::string> sentences = check.advice();
    if (check.is_out_of_step()) {
      sentences.push_back("scans and poses are out of step: scan_pose_offset_s should be " +
                          pose_offset_text(check.pose_offset().estimate()));
    }
    const std::string no_return = check.no_return_advice();
    if (!no_return.empty()) sentences.push_back(no_return);
    return sentences;
  }

  RangeLimiterParams params;
  ScannerCheck check;
  // Kept for their memory:
  Scan limited;
  Points points;
};

/// Makes scans of clouds.
struct SlicedClouds {
  explicit SlicedClouds(const CloudSliceParams& of) : params(of) {}

  Scan scan_of(const Cloud& cloud, const Eigen::Isometry3d& T_world_lidar, const Eigen::Isometry3d& T_world_lidar_end) {
    slice = slice_cloud(cloud, T_world_lidar, T_world_lidar_end, params, std::move(slice));
    ++count;
    without_valid_times += slice.times_valid ? 0 : 1;
    untimed_returns += slice.untimed_returns;
    untimed.add(slice, T_world_lidar, params);
    // As the nodelets pass it on.
    const double duration_s = static_cast<double>(slice.scan.beams.size() - 1) * slice.scan.time_increment_s;
    return scan_from_msg(scan_to_msg(slice.scan, "level", params.min_range_m, params.max_range_m, duration_s));
  }

  std::vector<std::string> warnings() const {
    std::vector<std::string> sentences;
    if (untimed_returns > 0) {
      sentences.push_back(formatted("%zu points dropped, whose times cannot be", untimed_returns));
    }
    if (without_valid_times > 0) {
      sentences.push_back(
          formatted("times of points of %zu of %zu clouds cannot be used: all are put where the first "
                    "was",
                    without_valid_times, count));
    }
    if (untimed.clouds() > 0) {
      sentences.push_back(
          formatted("points of %zu of %zu clouds have no times, but the sensor moves while it sweeps, by "
                    "up to %.2f m: so much hits are off",
                    untimed.clouds(), count, untimed.most_m()));
    }
    return sentences;
  }

  CloudSliceParams params;
  CloudTimeReader times;
  CloudSlice slice;
  UntimedMotion untimed;
  std::size_t count = 0, without_valid_times = 0, untimed_returns = 0;
};

void warn_at_end(BagPlayer& player, const std::string& topic, const std::shared_ptr<const CheckedScanner>& checked) {
  player.on_summary([checked, topic] {
    std::vector<std::string> sentences = checked->advice();
    for (std::string& sentence : sentences) sentence = topic + ": " + sentence;
    return sentences;
  });
}

}  // namespace

std::shared_ptr<const ScannerCheck> subscribe_scans(BagPlayer& player, const std::string& topic,
                                                    const RangeLimiterParams& params, UseScan use,
                                                    const std::string& lidar_frame) {
  const auto checked = std::make_shared<CheckedScanner>(params, player.scan_offset_s());
  player.subscribe_measurements<sensor_msgs::LaserScan>(
      topic, "scans",
      [&player, checked, use = std::move(use), frame = tf2_frame(lidar_frame)](
          const sensor_msgs::LaserScanConstPtr& recorded_msg, const ros::Time& recorded) {
        const sensor_msgs::LaserScanConstPtr msg = conventional(recorded_msg, checked->params.scanner);
        const std::string defect = scan_msg_defect(*msg);
        if (!defect.empty()) return player.drop(defect);
        Taken scan_taken = taken(*msg);
        if (!frame.empty()) scan_taken.frame = frame;
        player.use_when_posed(
            scan_taken, recorded,
            [msg, checked, &use](const Eigen::Isometry3d& T_world_lidar,
                                 const Eigen::Isometry3d& T_world_lidar_end) -> std::string {
              const Scan scan = scan_from_msg(*msg);
              const char* const reason = projection_defect(scan, T_world_lidar, T_world_lidar_end);
              if (*reason != '\0') return reason;
              use(scan, T_world_lidar, T_world_lidar_end);
              checked->check.add_ranges(msg->ranges, msg->range_max);
              checked->add(scan, T_world_lidar, T_world_lidar_end);
              return "";
            },
            player.scan_offset_s());
      });
  warn_at_end(player, topic, checked);
  return {checked, &checked->check};
}

std::shared_ptr<const ScannerCheck> subscribe_clouds(BagPlayer& player, const std::string& topic,
                                                     const RangeLimiterParams& params,
                                                     const CloudSliceParams& cloud_params, UseScan use,
                                                     const std::string& lidar_frame) {
  const auto checked = std::make_shared<CheckedScanner>(params, player.scan_offset_s());
  const auto clouds = std::make_shared<SlicedClouds>(cloud_params);
  player.subscribe_measurements<sensor_msgs::PointCloud2>(
      topic, "clouds",
      [&player, checked, clouds, use = std::move(use), frame = tf2_frame(lidar_frame)](
          const sensor_msgs::PointCloud2ConstPtr& msg, const ros::Time& recorded) {
        const std::string defect = cloud_msg_defect(*msg);
        if (!defect.empty()) return player.drop(defect);
        const CloudMsgTimes times = cloud_msg_times(*msg, clouds->times);
        Taken cloud_taken = taken(*msg, times, true);
        if (!frame.empty()) cloud_taken.frame = frame;
        player.use_when_posed(
            cloud_taken, recorded,
            [msg, times, checked, clouds, &use](const Eigen::Isometry3d& T_world_lidar,
                                                const Eigen::Isometry3d& T_world_lidar_end) -> std::string {
              const Scan scan = clouds->scan_of(cloud_from_msg(*msg, times), T_world_lidar, T_world_lidar_end);
              const Eigen::Isometry3d& T_world_level = clouds->slice.T_world_level;
              const char* const reason = projection_defect(scan, T_world_level, T_world_level);
              if (*reason != '\0') return reason;
              use(scan, T_world_level, T_world_level);
              checked->add(scan, T_world_level, T_world_level);
              return "";
            },
            player.scan_offset_s());
      });
  player.on_summary([clouds] { return clouds->warnings(); });
  warn_at_end(player, topic, checked);
  return {checked, &checked->check};
}

void add_scan_options(CommandLine& app, ScanTopics& topics) {
  const CommandLineOption scans =
      app.add_option("--scan-topic", topics.scans, "sensor_msgs/LaserScan").type_name("TOPIC");
  app.add_option("--cloud-topic", topics.clouds, "sensor_msgs/PointCloud2, in place of scans: its level slice")
      .type_name("TOPIC")
      .excludes(scans);
}

std::shared_ptr<const ScannerCheck> subscribe_scans_or_clouds(BagPlayer& player, const ScanTopics& topics,
                                                              const RangeLimiterParams& params,
                                                              const CloudSliceParams& cloud_params, UseScan use,
                                                              const std::string& lidar_frame) {
  return topics.clouds.empty()
             ? subscribe_scans(player, topics.scans, params, std::move(use), lidar_frame)
             : subscribe_clouds(player, topics.clouds, params, cloud_params, std::move(use), lidar_frame);
}

}  // namespace situation_awareness
