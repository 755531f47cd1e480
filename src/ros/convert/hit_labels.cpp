// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/hit_labels.hpp"

#include <cstddef>
#include <cstdint>
#include <stdexcept>

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/register_point_struct.h>
#include <pcl_conversions/pcl_conversions.h>

#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/markers/colors.hpp"

namespace situation_awareness {

/// A hit and its label as a point of PCL, 32 bytes.
struct EIGEN_ALIGN16 HitPoint {
  PCL_ADD_POINT4D;
  PCL_ADD_RGB;
  std::uint32_t object;
  std::uint32_t segment;
  std::uint8_t fate;
  std::uint8_t reason;
  PCL_MAKE_ALIGNED_OPERATOR_NEW
};

}  // namespace situation_awareness

// clang-format off
POINT_CLOUD_REGISTER_POINT_STRUCT(situation_awareness::HitPoint,
  (float, x, x)(float, y, y)(float, z, z)(float, rgb, rgb)
  (std::uint32_t, object, object)(std::uint32_t, segment, segment)
  (std::uint8_t, fate, fate)(std::uint8_t, reason, reason))
// clang-format on

namespace situation_awareness {
namespace {

Color hit_color(const HitLabel& label) {
  switch (label.fate) {
    case HitFate::kObject:
      return label.object_id == 0 ? kNoIdColor : color_of(label.object_id);
    case HitFate::kRefused:
      return kRefusedColor;
    case HitFate::kStructure:
      return kStructureColor;
    case HitFate::kNoSegment:
      break;
  }
  return kNoSegmentColor;
}

}  // namespace

sensor_msgs::PointCloud2 hit_labels_to_cloud(const Segments& segments, const std::vector<HitLabel>& labels,
                                             const std::string& world_frame) {
  if (labels.size() != segments.points.size()) throw std::invalid_argument("labels are not one for each hit");
  pcl::PointCloud<HitPoint> cloud(static_cast<std::uint32_t>(labels.size()), 1);
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const HitLabel& label = labels[i];
    const Eigen::Vector2d p_world_m = segments.T_world_level * segments.points[i].p_level_m;
    HitPoint& point = cloud[i];
    point.x = static_cast<float>(p_world_m.x());
    point.y = static_cast<float>(p_world_m.y());
    point.z = static_cast<float>(segments.height_world_m);
    point.rgba = packed_rgb(hit_color(label));
    point.object = static_cast<std::uint32_t>(label.object_id);
    point.segment = static_cast<std::uint32_t>(label.segment);
    point.fate = static_cast<std::uint8_t>(label.fate);
    point.reason = label.reason;
  }
  sensor_msgs::PointCloud2 msg;
  pcl::toROSMsg(cloud, msg);
  msg.header.stamp = to_ros_time(segments.stamp_ns);  // PCL's has microseconds
  msg.header.frame_id = world_frame;
  return msg;
}

}  // namespace situation_awareness
