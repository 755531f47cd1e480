// SPDX-License-Identifier: BSD-3-Clause
// In place of label_camera.cpp where EGL was not found: a label camera has its times, but draws nothing.
#include <stdexcept>

#include "situation_awareness/sim/label_camera.hpp"

namespace situation_awareness {

class SimulatedLabelCamera::Impl {
 public:
  [[noreturn]] void refuse() const {
    throw std::runtime_error(path + ": a label camera needs rendering, but EGL was not found at build time");
  }

  std::string path;
  SimulatedLabelCameraParams params;
  std::uint64_t images = 0;
};

SimulatedLabelCamera::SimulatedLabelCamera(const World& world, const Eigen::Isometry3d& /*T_robot_camera*/,
                                           const SimulatedLabelCameraParams& params)
    : impl_(std::make_unique<Impl>(Impl{world.path(), (params.validate(), params)})) {}
SimulatedLabelCamera::~SimulatedLabelCamera() = default;
SimulatedLabelCamera::SimulatedLabelCamera(SimulatedLabelCamera&&) noexcept = default;

const SimulatedLabelCameraParams& SimulatedLabelCamera::params() const { return impl_->params; }
const std::vector<std::string>& SimulatedLabelCamera::class_names() { impl_->refuse(); }
double SimulatedLabelCamera::next_time_s() const { return static_cast<double>(impl_->images) / impl_->params.rate_hz; }
LabelImage SimulatedLabelCamera::next() { impl_->refuse(); }
LabelImage SimulatedLabelCamera::at(double /*time_s*/, const Eigen::Isometry3d& /*T_world_camera*/) { impl_->refuse(); }
void SimulatedLabelCamera::skip() { ++impl_->images; }

}  // namespace situation_awareness
