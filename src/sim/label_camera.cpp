// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/label_camera.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "offscreen.hpp"
#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

constexpr std::uint16_t kNothing = 0, kNoMaterial = 1;

void copy(const Eigen::Vector3d& from, float* to) { Eigen::Map<Eigen::Vector3f>{to} = from.cast<float>(); }

}  // namespace

class SimulatedLabelCamera::Impl {
 public:
  Impl(const World& world, const Eigen::Isometry3d& T_robot_camera, const SimulatedLabelCameraParams& params)
      : world_(world), T_robot_camera_(T_robot_camera), params_((params.validate(), params)) {}

  LabelImage next() {
    const double time_s = next_time_s();
    ++images_;
    return at(time_s, world_.robot_at(time_s).T_world_robot * T_robot_camera_);
  }

  LabelImage at(double time_s, const Eigen::Isometry3d& T_world_camera) {
    LabelImage image;
    image.stamp_ns = nanoseconds(time_s);
    image.width = params_.width;
    image.height = params_.height;
    image.focal_length_px = 0.5 * params_.height / std::tan(0.5 * params_.fovy_rad);
    image.T_world_camera = T_world_camera;

    OffscreenWorld& drawn = this->drawn();
    const MujocoThrows guard;
    mjvCamera any;
    mjv_defaultCamera(&any);
    drawn.update_scene(time_s, world_.robot_at(time_s).T_world_robot, any);
    look_from(image.T_world_camera);
    mjvScene& scene = drawn.scene();
    if (params_.color != 0) image.rgb = drawn.render();
    // A segmentation image has the number of each shape plus one as a colour, low byte first; 0 is the background.
    scene.flags[mjRND_SEGMENT] = scene.flags[mjRND_IDCOLOR] = 1;
    for (int i = 0; i < scene.ngeom; ++i) scene.geoms[i].segid = i;
    const std::vector<std::uint8_t> numbers = drawn.render();
    scene.flags[mjRND_SEGMENT] = scene.flags[mjRND_IDCOLOR] = 0;
    for (std::size_t k = 0; k < numbers.size(); k += 3) {
      const int shape = numbers[k] + 256 * numbers[k + 1] + 65536 * numbers[k + 2] - 1;
      const bool is_geom = shape >= 0 && shape < scene.ngeom && scene.geoms[shape].objtype == mjOBJ_GEOM;
      const int geom = is_geom ? scene.geoms[shape].objid : -1;
      image.objects.push_back(object_of(geom));
      image.classes.push_back(class_of(geom));
    }
    return image;
  }

  void skip() { ++images_; }

  double next_time_s() const { return static_cast<double>(images_) / params_.rate_hz; }
  const SimulatedLabelCameraParams& params() const { return params_; }
  const std::vector<std::string>& class_names() {
    drawn();
    return class_names_;
  }

 private:
  /// Made when it is first needed.
  OffscreenWorld& drawn() {
    if (drawn_) return *drawn_;
    drawn_.emplace(world_.path(), params_.width, params_.height);
    const mjModel& model = drawn_->world().model();
    class_names_ = {"nothing", "no material"};
    for (int material = 0; material < model.nmat; ++material) {
      const char* const name = mj_id2name(&model, mjOBJ_MATERIAL, material);
      class_names_.emplace_back(name != nullptr ? name : "");
    }
    object_of_body_.assign(static_cast<std::size_t>(model.nbody), 0);
    std::uint16_t id = 0;
    for (const WorldObject& object : drawn_->world().objects()) {
      object_of_body_[static_cast<std::size_t>(model.geom_bodyid[object.geom])] = ++id;
    }
    return *drawn_;
  }

  std::uint16_t object_of(int geom) {
    if (geom < 0) return 0;
    return object_of_body_[static_cast<std::size_t>(drawn_->world().model().geom_bodyid[geom])];
  }

  std::uint16_t class_of(int geom) {
    if (geom < 0) return kNothing;
    const int material = drawn_->world().model().geom_matid[geom];
    return material < 0 ? kNoMaterial : static_cast<std::uint16_t>(kNoMaterial + 1 + material);
  }

  void look_from(const Eigen::Isometry3d& T_world_camera) {
    const mjModel& model = drawn_->world().model();
    const double near_m = model.vis.map.znear * model.stat.extent, far_m = model.vis.map.zfar * model.stat.extent;
    for (mjvGLCamera& eye : drawn_->scene().camera) {
      copy(T_world_camera.translation(), eye.pos);
      copy(T_world_camera.linear().col(2), eye.forward);
      copy(-T_world_camera.linear().col(1), eye.up);
      eye.frustum_center = 0.0F;
      eye.frustum_top = static_cast<float>(near_m * std::tan(0.5 * params_.fovy_rad));
      eye.frustum_bottom = -eye.frustum_top;
      eye.frustum_near = static_cast<float>(near_m);
      eye.frustum_far = static_cast<float>(far_m);
    }
  }

  const World& world_;
  Eigen::Isometry3d T_robot_camera_;
  SimulatedLabelCameraParams params_;
  std::optional<OffscreenWorld> drawn_;
  std::vector<std::string> class_names_;
  std::vector<std::uint16_t> object_of_body_;  ///< id, or 0
  std::uint64_t images_ = 0;
};

SimulatedLabelCamera::SimulatedLabelCamera(const World& world, const Eigen::Isometry3d& T_robot_camera,
                                           const SimulatedLabelCameraParams& params)
    : impl_(std::make_unique<Impl>(world, T_robot_camera, params)) {}
SimulatedLabelCamera::~SimulatedLabelCamera() = default;
SimulatedLabelCamera::SimulatedLabelCamera(SimulatedLabelCamera&&) noexcept = default;

const SimulatedLabelCameraParams& SimulatedLabelCamera::params() const { return impl_->params(); }
const std::vector<std::string>& SimulatedLabelCamera::class_names() { return impl_->class_names(); }
double SimulatedLabelCamera::next_time_s() const { return impl_->next_time_s(); }
LabelImage SimulatedLabelCamera::next() { return impl_->next(); }
LabelImage SimulatedLabelCamera::at(double time_s, const Eigen::Isometry3d& T_world_camera) {
  return impl_->at(time_s, T_world_camera);
}
void SimulatedLabelCamera::skip() { impl_->skip(); }

}  // namespace situation_awareness
