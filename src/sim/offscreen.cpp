// SPDX-License-Identifier: BSD-3-Clause
#include "offscreen.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <stdexcept>

#include <EGL/egl.h>
#include <EGL/eglext.h>

namespace situation_awareness {
namespace {

int checked_size(int size, const std::string& name) {
  if (size >= 16 && size <= 4096) return size;
  throw std::invalid_argument(name + " = " + std::to_string(size) + " is outside [16, 4096]");
}

}  // namespace

/// An OpenGL context without a window.
class OffscreenWorld::Context {
 public:
  Context() {
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
    if (context_ != EGL_NO_CONTEXT && make_current()) return;
    end();
    throw std::runtime_error("EGL makes no context without a surface");
  }
  ~Context() { end(); }
  /// Others may have been made current in this thread since. False where EGL takes no context without a surface.
  bool make_current() const { return eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) == EGL_TRUE; }
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

 private:
  bool begin() const { return display_ != EGL_NO_DISPLAY && eglInitialize(display_, nullptr, nullptr) == EGL_TRUE; }
  void end() const {
    if (display_ == EGL_NO_DISPLAY) return;
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (context_ != EGL_NO_CONTEXT) eglDestroyContext(display_, context_);
    // Not terminated: all contexts of the process share the display.
  }

  EGLDisplay display_ = EGL_NO_DISPLAY;
  EGLContext context_ = EGL_NO_CONTEXT;
};

OffscreenWorld::OffscreenWorld(const std::string& mjcf_path, int width, int height)
    : width_(checked_size(width, "width")),
      height_(checked_size(height, "height")),
      world_(mjcf_path),
      context_(std::make_unique<Context>()) {
  mjModel& model = world_.model();
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

OffscreenWorld::~OffscreenWorld() {
  context_->make_current();
  mjr_freeContext(&renderer_);
  mjv_freeScene(&scene_);
}

void OffscreenWorld::update_scene(double time_s, const Eigen::Isometry3d& T_world_robot, mjvCamera& camera) {
  mjModel& model = world_.model();
  mjData& data = world_.data();
  world_.place(time_s, T_world_robot);
  world_.place_decorations(time_s);
  mj_comPos(&model, &data);
  mj_camlight(&model, &data);
  mjv_updateScene(&model, &data, &option_, nullptr, &camera, mjCAT_ALL, &scene_);
}

std::vector<std::uint8_t> OffscreenWorld::render() {
  if (!context_->make_current()) throw std::runtime_error("EGL has lost its context");
  const mjrRect all = {0, 0, width_, height_};
  mjr_render(all, &scene_, &renderer_);
  const std::size_t row_bytes = 3 * static_cast<std::size_t>(width_);
  std::vector<std::uint8_t> from_below(row_bytes * static_cast<std::size_t>(height_));
  mjr_readPixels(from_below.data(), nullptr, all, &renderer_);
  std::vector<std::uint8_t> rgb;
  rgb.reserve(from_below.size());
  for (int row = height_ - 1; row >= 0; --row) {
    const auto begin = from_below.begin() + row * static_cast<std::ptrdiff_t>(row_bytes);
    rgb.insert(rgb.end(), begin, begin + static_cast<std::ptrdiff_t>(row_bytes));
  }
  return rgb;
}

}  // namespace situation_awareness
