// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/image/image.hpp"

namespace situation_awareness {

/// How a lens bends what a pinhole camera would show, in the terms of OpenCV and sensor_msgs/CameraInfo.
struct LensDistortion {
  enum class Model {
    kPolynomial,   ///< plumb_bob and rational_polynomial: 4, 5, 8, 12 or 14 coefficients
    kEquidistant,  ///< of a fisheye: 4 coefficients
  };
  Model model = Model::kPolynomial;
  std::vector<double> coefficients;
  Eigen::Matrix3d R_rectified_camera = Eigen::Matrix3d::Identity();  ///< to the frame of the rectified image

  bool operator==(const LensDistortion& other) const {
    return model == other.model && coefficients == other.coefficients && R_rectified_camera == other.R_rectified_camera;
  }
};

/// Label images as a camera without distortion would have them. It keeps how the pixels of the latest camera move.
class Undistortion {
 public:
  Undistortion();
  Undistortion(const Undistortion&) = delete;
  Undistortion& operator=(const Undistortion&) = delete;
  ~Undistortion();

  /// `labels.camera` is that of the lens: it becomes the one of the result, with the same focal lengths and of the size
  /// that holds all of the image, twice as wide and high at most. Probabilities are interpolated; those of directions
  /// that the image does not show are NaN. False, and the labels are as they were: the distortion cannot be undone.
  /// Throws as check(SoftLabels), and std::invalid_argument for a number of coefficients that the model does not have.
  bool undistort(SoftLabels& labels, const LensDistortion& distortion);

 private:
  struct Map;
  std::unique_ptr<Map> map_;
};

}  // namespace situation_awareness
