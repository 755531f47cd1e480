// SPDX-License-Identifier: BSD-3-Clause
// In place of label_camera.cpp where EGL was not found: a world that asks for a label camera is refused.
#include <stdexcept>

#include "situation_awareness/sim/label_camera.hpp"

namespace situation_awareness {

class SimulatedLabelCamera::Impl {
 public:
  SimulatedLabelCameraParams params;
  std::vector<std::string> class_names;
};

SimulatedLabelCamera::SimulatedLabelCamera(const World& world, const Eigen::Isometry3d& /*T_robot_camera*/,
                                           const SimulatedLabelCameraParams& /*params*/) {
  throw std::runtime_error(world.path() + ": a label camera needs rendering, but EGL was not found at build time");
}
SimulatedLabelCamera::~SimulatedLabelCamera() = default;
SimulatedLabelCamera::SimulatedLabelCamera(SimulatedLabelCamera&&) noexcept = default;

const SimulatedLabelCameraParams& SimulatedLabelCamera::params() const { return impl_->params; }
const std::vector<std::string>& SimulatedLabelCamera::class_names() const { return impl_->class_names; }
double SimulatedLabelCamera::next_time_s() const { return 0.0; }
LabelImage SimulatedLabelCamera::next() { return {}; }
LabelImage SimulatedLabelCamera::at(double /*time_s*/, const Eigen::Isometry3d& /*T_world_camera*/) { return {}; }
void SimulatedLabelCamera::skip() {}

}  // namespace situation_awareness
