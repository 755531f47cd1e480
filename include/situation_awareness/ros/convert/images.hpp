// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include "situation_awareness/sim/camera_view.hpp"
#include "situation_awareness/sim/label_camera.hpp"

namespace situation_awareness {

/// A pinhole camera without distortion whose optical axis passes through the image's centre. The frame has z ahead, x
/// to the right and y down. Column and row of a pixel are the coordinates of its centre, as image_geometry and OpenCV
/// have it: the point p projects to K p / p_z, and the pixel nearest to that shows it.
sensor_msgs::CameraInfo camera_info_to_msg(int width, int height, double focal_length_px, std::int64_t stamp_ns,
                                           const std::string& camera_frame);

/// As rgb8.
sensor_msgs::Image picture_to_msg(const Picture& picture, std::int64_t stamp_ns, const std::string& camera_frame);

/// The images of a label camera as messages: ids of objects, and classes, as mono16, low byte first.
sensor_msgs::Image objects_image_to_msg(const LabelImage& image, const std::string& camera_frame);
sensor_msgs::Image classes_image_to_msg(const LabelImage& image, const std::string& camera_frame);

/// The share of each block of `block_px` x `block_px` pixels whose class `is_class` says yes of (an index in
/// SimulatedLabelCamera::class_names()): 32FC1, and the camera of these labels. Pixels that do not fill a block are
/// left out, as many at either edge.
sensor_msgs::Image soft_labels_to_msg(const LabelImage& image, const std::vector<bool>& is_class, int block_px,
                                      const std::string& camera_frame);
sensor_msgs::CameraInfo labels_info_to_msg(const LabelImage& image, int block_px, const std::string& camera_frame);

}  // namespace situation_awareness
