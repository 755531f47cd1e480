// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/scans.hpp"

#include <utility>
#include <vector>

#include <sensor_msgs/LaserScan.h>

#include "situation_awareness/points/horizontal_projection.hpp"
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

  void add(const sensor_msgs::LaserScan& msg, const Scan& scan, const Eigen::Isometry3d& T_world_lidar,
           const Eigen::Isometry3d& T_world_lidar_end) {
    check.add_ranges(msg.ranges, msg.range_max);
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

}  // namespace

std::shared_ptr<const ScannerCheck> subscribe_scans(BagPlayer& player, const std::string& topic,
                                                    const RangeLimiterParams& params, UseScan use,
                                                    const std::string& lidar_frame) {
  const auto checked = std::make_shared<CheckedScanner>(params, player.pose_offset_s());
  player.subscribe_measurements<sensor_msgs::LaserScan>(
      topic, "scans",
      [&player, checked, use = std::move(use), frame = tf2_frame(lidar_frame)](
          const sensor_msgs::LaserScanConstPtr& recorded_msg, const ros::Time& recorded) {
        const sensor_msgs::LaserScanConstPtr msg = conventional(recorded_msg, checked->params.scanner);
        const std::string defect = scan_msg_defect(*msg);
        if (!defect.empty()) return player.drop(defect);
        Taken scan_taken = taken(*msg);
        if (!frame.empty()) scan_taken.frame = frame;
        player.use_when_posed(scan_taken, recorded,
                              [msg, checked, &use](const Eigen::Isometry3d& T_world_lidar,
                                                   const Eigen::Isometry3d& T_world_lidar_end) -> std::string {
                                const Scan scan = scan_from_msg(*msg);
                                const char* const reason = projection_defect(scan, T_world_lidar, T_world_lidar_end);
                                if (*reason != '\0') return reason;
                                use(scan, T_world_lidar, T_world_lidar_end);
                                checked->add(*msg, scan, T_world_lidar, T_world_lidar_end);
                                return "";
                              });
      });
  player.on_summary([checked, topic] {
    std::vector<std::string> sentences = checked->advice();
    for (std::string& sentence : sentences) sentence = topic + ": " + sentence;
    return sentences;
  });
  return {checked, &checked->check};
}

}  // namespace situation_awareness
