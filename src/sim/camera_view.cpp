// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/camera_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <mujoco/mujoco.h>

#include "situation_awareness/geometry/angles.hpp"
#include "world_model.hpp"

namespace situation_awareness {
namespace {

/// An OpenGL context without a window, current in this thread.
class Context {
 public:
  Context() try {
    display_ = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
    if (!begin()) {  // drivers that are not Mesa's
      display_ = eglGetDisplay(EGL_DEFAULT_DISPLAY);
      if (!begin()) throw std::runtime_error("EGL has no display");
    }
    if (eglBindAPI(EGL_OPENGL_API) != EGL_TRUE) throw std::runtime_error("EGL has no OpenGL");
    constexpr std::array<EGLint, 13> kWanted = {EGL_RED_SIZE,
                                                8,
                                                EGL_GREEN_SIZE,
                                                8,
                                                EGL_BLUE_SIZE,
                                                8,
                                                EGL_DEPTH_SIZE,
                                                24,
                                                EGL_SURFACE_TYPE,
                                                EGL_PBUFFER_BIT,
                                                EGL_RENDERABLE_TYPE,
                                                EGL_OPENGL_BIT,
                                                EGL_NONE};
    EGLConfig config = nullptr;
    EGLint count = 0;
    if (eglChooseConfig(display_, kWanted.data(), &config, 1, &count) != EGL_TRUE || count < 1) {
      throw std::runtime_error("EGL has no format of 8 bits per colour");
    }
    context_ = eglCreateContext(display_, config, EGL_NO_CONTEXT, nullptr);
    if (context_ == EGL_NO_CONTEXT || eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) != EGL_TRUE) {
      throw std::runtime_error("EGL makes no context without a surface");
    }
  } catch (...) {
    end();
    throw;
  }
  ~Context() { end(); }
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

 private:
  bool begin() const { return display_ != EGL_NO_DISPLAY && eglInitialize(display_, nullptr, nullptr) == EGL_TRUE; }
  void end() const {
    if (display_ == EGL_NO_DISPLAY) return;
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (context_ != EGL_NO_CONTEXT) eglDestroyContext(display_, context_);
    eglTerminate(display_);
  }

  EGLDisplay display_ = EGL_NO_DISPLAY;
  EGLContext context_ = EGL_NO_CONTEXT;
};

int checked_size(int size, const std::string& name) {
  if (size >= 16 && size <= 4096) return size;
  throw std::invalid_argument(name + " = " + std::to_string(size) + " is outside [16, 4096]");
}

}  // namespace

class CameraView::Impl {
 public:
  Impl(const std::string& mjcf_path, const std::string& camera, int width, int height)
      : width_(checked_size(width, "width")), height_(checked_size(height, "height")), world_(mjcf_path) {
    mjModel& model = world_.model();
    camera_ = mj_name2id(&model, mjOBJ_CAMERA, camera.c_str());
    if (camera_ < 0) throw std::runtime_error(mjcf_path + ": there is no camera '" + camera + "'");
    model.vis.global.offwidth = width_;
    model.vis.global.offheight = height_;
    model.vis.quality.offsamples = 0;  // smooth edges cost four times the time where there is no GPU
    const MujocoThrows guard;
    mjv_defaultScene(&scene_);
    mjr_defaultContext(&renderer_);
    mjv_defaultOption(&option_);
    std::fill(std::begin(option_.sitegroup), std::end(option_.sitegroup), mjtByte{0});
    mjv_makeScene(&model, &scene_, model.ngeom + 100);
    mjr_makeContext(&model, &renderer_, mjFONTSCALE_100);
    mjr_setBuffer(mjFB_OFFSCREEN, &renderer_);
    if (renderer_.currentBuffer != mjFB_OFFSCREEN) throw std::runtime_error("OpenGL has no buffer to draw into");
  }
  ~Impl() {
    mjr_freeContext(&renderer_);
    mjv_freeScene(&scene_);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  Picture at(double time_s, const Eigen::Isometry3d& T_world_robot) {
    const MujocoThrows guard;
    mjModel& model = world_.model();
    mjData& data = world_.data();
    world_.place(time_s, T_world_robot);
    world_.place_decorations(time_s);
    mj_comPos(&model, &data);
    mj_camlight(&model, &data);
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(data.cam_xmat + 9 * camera_);
    T_world_camera_.linear() << R.col(0), -R.col(1), -R.col(2);  // MuJoCo's cameras look along -z, with y up
    T_world_camera_.translation() = Eigen::Map<const Eigen::Vector3d>(data.cam_xpos + 3 * camera_);

    mjvCamera camera;
    mjv_defaultCamera(&camera);
    camera.type = mjCAMERA_FIXED;
    camera.fixedcamid = camera_;
    mjv_updateScene(&model, &data, &option_, nullptr, &camera, mjCAT_ALL, &scene_);
    const mjrRect all = {0, 0, width_, height_};
    mjr_render(all, &scene_, &renderer_);

    const std::size_t row_bytes = 3 * static_cast<std::size_t>(width_);
    std::vector<std::uint8_t> from_below(row_bytes * static_cast<std::size_t>(height_));
    mjr_readPixels(from_below.data(), nullptr, all, &renderer_);
    Picture picture{width_, height_, {}};
    picture.rgb.reserve(from_below.size());
    for (int row = height_ - 1; row >= 0; --row) {
      const auto begin = from_below.begin() + row * static_cast<std::ptrdiff_t>(row_bytes);
      picture.rgb.insert(picture.rgb.end(), begin, begin + static_cast<std::ptrdiff_t>(row_bytes));
    }
    return picture;
  }

  const Eigen::Isometry3d& T_world_camera() const { return T_world_camera_; }

  double focal_length_px() { return 0.5 * height_ / std::tan(0.5 * radians(world_.model().cam_fovy[camera_])); }

 private:
  int width_, height_;
  WorldModel world_;
  int camera_ = -1;
  Context context_;
  mjvScene scene_;
  mjrContext renderer_;
  mjvOption option_;
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
