// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/detections.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

#include "situation_awareness/ros/convert/free_space.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

using RowMajor5d = Eigen::Matrix<double, 5, 5, Eigen::RowMajor>;

}  // namespace

DetectionArray detections_to_msg(const Detections& detections, const std::string& world_frame) {
  DetectionArray msg;
  msg.header.stamp = to_ros_time(detections.stamp_ns);
  msg.header.frame_id = world_frame;
  msg.level = level_to_msg(detections.T_world_level, detections.height_world_m);
  free_space_to_msg(detections.free_space, msg);
  msg.detections.resize(detections.detections.size());
  for (std::size_t i = 0; i < detections.detections.size(); ++i) {
    const Detection& detection = detections.detections[i];
    EllipseDetection& element = msg.detections[i];
    element.x = detection.ellipse_level.center_m.x();
    element.y = detection.ellipse_level.center_m.y();
    element.psi = detection.ellipse_level.psi_rad;
    element.rx = detection.ellipse_level.rx_m;
    element.ry = detection.ellipse_level.ry_m;
    Eigen::Map<RowMajor5d>(element.covariance.data()) = detection.covariance;
    element.p_ellipse = detection.p_ellipse;
    element.log_box_ratio = detection.log_box_ratio;
    if (detection.shape == Shape::kBox) {
      element.shape = EllipseDetection::BOX;
      element.box_psi = detection.box_level.psi_rad;
      element.box_length = 2.0 * detection.box_level.half_length_m;
      element.box_width = 2.0 * detection.box_level.half_width_m;
    }
    element.residual = detection.residual_rms_m;
    element.time_offset = detection.time_offset_s;
    element.beams = static_cast<std::uint32_t>(detection.beams);
    element.middle_x = detection.middle_level_m.x();
    element.middle_y = detection.middle_level_m.y();
    element.hidden_end = static_cast<std::uint8_t>(detection.hidden_end);
    element.has_arrived = static_cast<std::uint8_t>(detection.has_arrived);
    element.segment = static_cast<std::uint32_t>(detection.segment);
  }
  for (const SmallSegment& small : detections.small_segments) {
    LaserSmallSegment& element = msg.small_segments.emplace_back();
    element.x = small.center_level_m.x();
    element.y = small.center_level_m.y();
    element.width = small.width_m;
    element.time_offset = small.time_offset_s;
    element.beams = static_cast<std::uint32_t>(small.beams);
  }
  return msg;
}

Detections detections_from_msg(const DetectionArray& msg) {
  Detections detections;
  detections.stamp_ns = to_nanoseconds(msg.header.stamp);
  level_from_msg(msg.level, detections.T_world_level, detections.height_world_m);
  detections.free_space = free_space_from_msg(msg);
  detections.detections.resize(msg.detections.size());
  for (std::size_t i = 0; i < msg.detections.size(); ++i) {
    const EllipseDetection& element = msg.detections[i];
    Detection& detection = detections.detections[i];
    detection.ellipse_level = {{element.x, element.y}, element.psi, element.rx, element.ry};
    detection.covariance = Eigen::Map<const RowMajor5d>(element.covariance.data());
    detection.p_ellipse = element.p_ellipse;
    detection.log_box_ratio = element.log_box_ratio;
    if (element.shape == EllipseDetection::BOX) {
      detection.shape = Shape::kBox;
      detection.box_level = {detection.ellipse_level.center_m, element.box_psi, 0.5 * element.box_length,
                             0.5 * element.box_width};
    } else if (element.shape != EllipseDetection::ELLIPSE) {
      throw std::invalid_argument("a detection is invalid: its shape is unknown");
    }
    detection.residual_rms_m = element.residual;
    detection.time_offset_s = element.time_offset;
    detection.beams = static_cast<int>(element.beams);
    detection.middle_level_m = {element.middle_x, element.middle_y};
    detection.hidden_end = element.hidden_end != 0;
    detection.has_arrived = element.has_arrived != 0;
    detection.segment = element.segment;
    const std::string defect = detection_defect(detection);
    if (!defect.empty()) throw std::invalid_argument("a detection is invalid: " + defect);
  }
  for (const LaserSmallSegment& element : msg.small_segments) {
    const bool finite = std::isfinite(element.x) && std::isfinite(element.y) && std::isfinite(element.width) &&
                        std::isfinite(element.time_offset);
    if (!finite || element.width < 0.0) throw std::invalid_argument("a small segment is not finite");
    detections.small_segments.push_back(
        {{element.x, element.y}, element.width, element.time_offset, static_cast<int>(element.beams)});
  }
  return detections;
}

}  // namespace situation_awareness
