// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/camera.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <stdexcept>
#include <utility>
#include <vector>

#include "situation_awareness/ros/convert/compressed_image.hpp"
#include "situation_awareness/ros/convert/poses.hpp"

namespace situation_awareness {
namespace {

constexpr double kSameMatrix = 1e-3;  ///< relative to the focal length: a tenth of a pixel of an image of 100
constexpr std::size_t kMostPolynomial = 14, kMostEquidistant = 4;
constexpr std::size_t kPolynomialCounts[] = {4, 5, 8, 12, 14};

/// The part of a camera's pixels that its images have, and how many of them make one.
struct Window {
  double left_px = 0.0, top_px = 0.0;
  double columns = 1.0, rows = 1.0;  ///< of the camera, in a pixel of the image
};

/// Of a number of pixels that is no multiple, drivers drop the rest or count it.
bool is_binned(std::uint32_t binned, std::uint32_t whole, std::uint32_t binning) {
  return binned == whole / binning || binned == (whole + binning - 1) / binning;
}

/// None if the image is of another size.
std::optional<Window> window_of(const sensor_msgs::CameraInfo& info, const sensor_msgs::Image& image) {
  if (image.width == info.width && image.height == info.height) return Window{};
  const bool has_roi = info.roi.width > 0 && info.roi.height > 0;
  const std::uint32_t width = has_roi ? info.roi.width : info.width, height = has_roi ? info.roi.height : info.height;
  const std::uint32_t columns = std::max(info.binning_x, 1U), rows = std::max(info.binning_y, 1U);
  if (!is_binned(image.width, width, columns) || !is_binned(image.height, height, rows)) return std::nullopt;
  return Window{has_roi ? static_cast<double>(info.roi.x_offset) : 0.0,
                has_roi ? static_cast<double>(info.roi.y_offset) : 0.0, static_cast<double>(columns),
                static_cast<double>(rows)};
}

/// Focal lengths and principal point of K or P.
struct Matrix {
  double fx_px, fy_px, cx_px, cy_px;

  bool is_finite() const {
    return std::isfinite(fx_px) && std::isfinite(fy_px) && std::isfinite(cx_px) && std::isfinite(cy_px);
  }
  bool has_focal_length() const { return fx_px > 0.0 && fy_px > 0.0; }
  bool is_same(const Matrix& other) const {
    const double most_px = kSameMatrix * fx_px;
    return std::abs(fx_px - other.fx_px) <= most_px && std::abs(fy_px - other.fy_px) <= most_px &&
           std::abs(cx_px - other.cx_px) <= most_px && std::abs(cy_px - other.cy_px) <= most_px;
  }
};

Matrix k_of(const sensor_msgs::CameraInfo& info) { return {info.K[0], info.K[4], info.K[2], info.K[5]}; }
Matrix p_of(const sensor_msgs::CameraInfo& info) { return {info.P[0], info.P[5], info.P[2], info.P[6]}; }

/// The image's left edge is at -0.5, as that of the camera is.
PinholeCamera camera_of(const Matrix& matrix, const Window& window, const sensor_msgs::Image& image) {
  return {static_cast<int>(image.width),
          static_cast<int>(image.height),
          matrix.fx_px / window.columns,
          matrix.fy_px / window.rows,
          (matrix.cx_px - window.left_px + 0.5) / window.columns - 0.5,
          (matrix.cy_px - window.top_px + 0.5) / window.rows - 0.5};
}

/// The identity where the message has none.
Eigen::Matrix3d rotation_of(const sensor_msgs::CameraInfo& info) {
  const Eigen::Matrix3d R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(info.R.data());
  const bool is_rotation = ((R * R.transpose()).isIdentity(1e-3) && R.determinant() > 0.0);
  return is_rotation && !R.isIdentity(1e-9) ? R : Eigen::Matrix3d::Identity();
}

bool is_equidistant(const sensor_msgs::CameraInfo& info) {
  return info.distortion_model == "equidistant" || info.distortion_model == "fisheye";
}

/// Sets the model's distortion or its defect.
void set_distortion(const sensor_msgs::CameraInfo& info, CameraModel& model) {
  LensDistortion distortion;
  const std::string& name = info.distortion_model;
  const bool is_fisheye = is_equidistant(info);
  if (is_fisheye) {
    distortion.model = LensDistortion::Model::kEquidistant;
  } else if (!name.empty() && name != "plumb_bob" && name != "rational_polynomial") {
    model.defect = "camera_info of another distortion model than plumb_bob, rational_polynomial and equidistant";
    return;
  }
  std::vector<double>& D = distortion.coefficients;
  D = info.D;
  while (!D.empty() && D.back() == 0.0) D.pop_back();
  if (!std::all_of(D.begin(), D.end(), [](double d) { return std::isfinite(d); })) {
    model.defect = "camera_info with a distortion that is not finite";
  } else if (D.size() > (is_fisheye ? kMostEquidistant : kMostPolynomial)) {
    model.defect = "camera_info with more of D than its distortion model has";
  } else if (is_fisheye) {
    D.resize(kMostEquidistant);
  } else {
    D.resize(*std::find_if(std::begin(kPolynomialCounts), std::end(kPolynomialCounts),
                           [&D](std::size_t count) { return count >= D.size(); }));
  }
  distortion.R_rectified_camera = rotation_of(info);
  model.distortion = std::move(distortion);
}

}  // namespace

ImageKind image_kind(const std::string& name, const std::string& topic) {
  if (name == "rectified") return ImageKind::kRectified;
  if (name == "raw") return ImageKind::kRaw;
  if (name != "auto") throw std::invalid_argument("image_kind is " + name + ", not auto, rectified or raw");
  const std::string bare = tf2_frame(without_transport(topic));
  const std::string last = bare.substr(bare.rfind('/') + 1);  // all of it where there is no slash
  if (last.rfind("image_rect", 0) == 0) return ImageKind::kRectified;
  if (last == "image_raw" || last == "image_mono" || last == "image_color") return ImageKind::kRaw;
  return ImageKind::kAuto;
}

bool is_size_of(const sensor_msgs::CameraInfo& info, const sensor_msgs::Image& image) {
  return window_of(info, image).has_value();
}

CameraModel camera_model(const sensor_msgs::CameraInfo& info, const sensor_msgs::Image& image, ImageKind kind) {
  CameraModel model;
  const std::optional<Window> window = window_of(info, image);
  if (!window) {
    model.defect = "camera_info of another size";
    return model;
  }
  const Matrix K = k_of(info), P = p_of(info);
  const bool has_p = P.is_finite() && P.has_focal_length(), is_p_other = has_p && !P.is_same(K);
  // An equidistant camera is no pinhole camera, also where D is 0.
  const bool is_bent =
      is_equidistant(info) || std::any_of(info.D.begin(), info.D.end(), [](double d) { return d != 0.0; });
  if (kind == ImageKind::kAuto && is_bent) {
    if (!is_p_other) {
      model.defect = "camera_info with distortion, whose P is no other than K: image_kind must say rectified or raw";
      return model;
    }
    kind = ImageKind::kRectified;
    model.assumed = "images are taken for rectified, with P of camera_info; image_kind raw undistorts them by K and D";
  } else if (kind == ImageKind::kAuto && is_p_other) {
    model.assumed = "images have K of camera_info, whose D is 0; image_kind rectified takes P, which is another";
  }
  const bool is_by_p = kind == ImageKind::kRectified && has_p;
  if (kind == ImageKind::kRectified && !has_p && is_bent) {
    model.defect = "camera_info without P, the matrix of rectified images";
    return model;
  }
  const Matrix& matrix = is_by_p ? P : K;
  if (!matrix.is_finite()) {
    model.defect = "camera_info with a matrix that is not finite";
  } else if (!matrix.has_focal_length()) {
    model.defect = "camera_info without focal length";
  }
  if (!model.defect.empty()) return model;
  model.camera = camera_of(matrix, *window, image);
  model.matrices = is_by_p ? "P" : "K";
  if (kind == ImageKind::kRaw && (is_bent || !rotation_of(info).isIdentity(0.0))) {
    model.matrices = "K and D";
    set_distortion(info, model);
  }
  return model;
}

std::string camera_info_msg_defect(const sensor_msgs::CameraInfo& info, const sensor_msgs::Image& image,
                                   ImageKind kind) {
  return camera_model(info, image, kind).defect;
}

std::string ImageCamera::undistort(SoftLabels& labels) {
  if (!model_.distortion || undistortion_.undistort(labels, *model_.distortion)) return "";
  return "camera_info with a distortion that cannot be undone";
}

}  // namespace situation_awareness
