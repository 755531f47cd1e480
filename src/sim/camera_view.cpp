// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/camera_view.hpp"

#include <cmath>
#include <stdexcept>

#include "offscreen.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

class CameraView::Impl {
 public:
  Impl(const std::string& mjcf_path, const std::string& camera, int width, int height)
      : drawn_(mjcf_path, width, height) {
    camera_ = mj_name2id(&drawn_.world().model(), mjOBJ_CAMERA, camera.c_str());
    if (camera_ < 0) throw std::runtime_error(mjcf_path + ": there is no camera '" + camera + "'");
  }

  Picture at(double time_s, const Eigen::Isometry3d& T_world_robot) {
    const MujocoThrows guard;
    mjvCamera camera;
    mjv_defaultCamera(&camera);
    camera.type = mjCAMERA_FIXED;
    camera.fixedcamid = camera_;
    drawn_.update_scene(time_s, T_world_robot, camera);
    const mjData& data = drawn_.world().data();
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(data.cam_xmat + 9 * camera_);
    T_world_camera_.linear() << R.col(0), -R.col(1), -R.col(2);  // MuJoCo's cameras look along -z, with y up
    T_world_camera_.translation() = Eigen::Map<const Eigen::Vector3d>(data.cam_xpos + 3 * camera_);
    return {drawn_.width(), drawn_.height(), drawn_.render()};
  }

  const Eigen::Isometry3d& T_world_camera() const { return T_world_camera_; }

  double focal_length_px() {
    return 0.5 * drawn_.height() / std::tan(0.5 * radians(drawn_.world().model().cam_fovy[camera_]));
  }

 private:
  OffscreenWorld drawn_;
  int camera_ = -1;
  Eigen::Isometry3d T_world_camera_ = Eigen::Isometry3d::Identity();
};

CameraView::CameraView(const std::string& mjcf_path, const std::string& camera, int width, int height)
    : impl_(std::make_unique<Impl>(mjcf_path, camera, width, height)) {}
CameraView::~CameraView() = default;

Picture CameraView::at(double time_s, const Eigen::Isometry3d& T_world_robot) {
  return impl_->at(time_s, T_world_robot);
}

const Eigen::Isometry3d& CameraView::T_world_camera() const { return impl_->T_world_camera(); }

double CameraView::focal_length_px() const { return impl_->focal_length_px(); }

}  // namespace situation_awareness
