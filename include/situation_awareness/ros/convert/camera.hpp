// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include "situation_awareness/image/image.hpp"
#include "situation_awareness/image/undistortion.hpp"

namespace situation_awareness {

/// What the images of a camera are: as the lens shows them, or rectified, as image_proc does it.
enum class ImageKind { kAuto, kRectified, kRaw };

/// Returns the kind that one of the names auto, rectified and raw means. With auto the topic decides where it is named
/// as those of image_proc are: image_rect and image_rect_color, or image_raw, image_mono and image_color. Throws
/// std::invalid_argument for another name.
ImageKind image_kind(const std::string& name, const std::string& topic);

/// Whether the camera's images have this size: all pixels, or what region of interest and binning leave of them.
bool is_size_of(const sensor_msgs::CameraInfo& info, const sensor_msgs::Image& image);

/// What a camera_info says of the directions of an image's pixels.
struct CameraModel {
  std::string defect;                        ///< why it cannot be used: a fixed text, for counters; empty: it can
  PinholeCamera camera;                      ///< of the image's size
  std::optional<LensDistortion> distortion;  ///< of an image that is raw
  std::string matrices;                      ///< what of camera_info this is
  std::string assumed;                       ///< in words, where camera_info suits both kinds of images; else empty
};

/// Rectified images have the matrix P, raw ones K, D and R. Of kAuto both are the same where there is no distortion:
/// image_proc copies such an image, and K counts. Else they are taken for rectified where P is not K, as a calibration
/// leaves it, and where it is nothing can tell.
CameraModel camera_model(const sensor_msgs::CameraInfo& info, const sensor_msgs::Image& image, ImageKind kind);

/// Returns the defect of the model; empty if there is none.
std::string camera_info_msg_defect(const sensor_msgs::CameraInfo& info, const sensor_msgs::Image& image,
                                   ImageKind kind = ImageKind::kAuto);

/// The camera of a topic's images.
class ImageCamera {
 public:
  /// `kind` and `topic` as those of image_kind, which it throws as.
  ImageCamera(const std::string& kind, const std::string& topic) : kind_(image_kind(kind, topic)) {}

  /// Returns the model of the next image. Without a defect its labels are to be undistorted.
  const CameraModel& take(const sensor_msgs::CameraInfo& info, const sensor_msgs::Image& image) {
    return model_ = camera_model(info, image, kind_);
  }

  /// Labels of the latest image without distortion. Returns why this cannot be, or an empty text.
  std::string undistort(SoftLabels& labels);

  /// Returns the model of the latest image.
  const CameraModel& model() const { return model_; }

 private:
  ImageKind kind_;
  CameraModel model_;
  Undistortion undistortion_;
};

}  // namespace situation_awareness
