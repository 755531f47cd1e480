// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/world.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <stdexcept>
#include <utility>

#include <mujoco/mujoco.h>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/sim/path.hpp"

namespace situation_awareness {
namespace {

// Geom groups of a world file.
constexpr int kSceneryGroup = 0;  // MuJoCo's default: walls, floor
constexpr int kObjectGroup = 1;   // the objects' ellipsoids; the scanner sees no higher group

/// An ellipsoid this tall is an elliptic cylinder to every ray of a LIDAR: 30 m up or down it is thinner by 5e-6.
constexpr double kHalfHeight_m = 1e4;

struct DeleteModel {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
};
struct DeleteData {
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using ModelPtr = std::unique_ptr<mjModel, DeleteModel>;
using DataPtr = std::unique_ptr<mjData, DeleteData>;

/// Turns what MuJoCo calls errors and warnings into exceptions for as long as it lives. By default MuJoCo ends the
/// process or writes MUJOCO_LOG.TXT. Its handlers, and the model it loaded last, are globals: hence the lock.
class MujocoThrows {
 public:
  MujocoThrows() : lock_(mutex()), error_(mju_user_error), warning_(mju_user_warning) {
    mju_user_error = throw_text;
    mju_user_warning = throw_text;
  }
  ~MujocoThrows() {
    mju_user_error = error_;
    mju_user_warning = warning_;
  }
  MujocoThrows(const MujocoThrows&) = delete;
  MujocoThrows& operator=(const MujocoThrows&) = delete;

 private:
  static std::mutex& mutex() {
    static std::mutex mutex;
    return mutex;
  }
  static void throw_text(const char* text) { throw std::runtime_error(text); }

  std::lock_guard<std::mutex> lock_;
  void (*error_)(const char*);
  void (*warning_)(const char*);
};

/// What MuJoCo says, on one line.
std::string one_line(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

struct Loaded {
  ModelPtr model;
  DataPtr data;
};

/// The compiled file, and its bodies where it puts them.
Loaded load(const std::string& mjcf_path) try {
  const MujocoThrows guard;
  std::array<char, 1000> complaint{};
  Loaded loaded;
  loaded.model.reset(mj_loadXML(mjcf_path.c_str(), nullptr, complaint.data(), static_cast<int>(complaint.size())));
  if (!loaded.model || complaint[0] != '\0') throw std::runtime_error(complaint.data());
  loaded.data.reset(mj_makeData(loaded.model.get()));
  if (!loaded.data) throw std::runtime_error("not enough memory for its data");
  mj_kinematics(loaded.model.get(), loaded.data.get());
  return loaded;
} catch (const std::runtime_error& error) {
  throw std::runtime_error("MuJoCo refuses it: " + one_line(error.what()));
}

std::string quoted_name(const mjModel& model, mjtObj type, int id) {
  const char* const name = mj_id2name(&model, type, id);
  return name != nullptr ? "'" + std::string(name) + "'" : "number " + std::to_string(id) + " (without a name)";
}

Eigen::Isometry3d isometry(const mjtNum* position, const mjtNum* rotation) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = Eigen::Map<const Eigen::Vector3d>(position);
  T.linear() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation);
  return T;
}

Eigen::Isometry3d body_pose(const mjData& data, int body) {
  return isometry(data.xpos + 3 * body, data.xmat + 9 * body);
}

/// The path in the <text> named like the body, or where there is none an empty one.
Path path_of(const mjModel& model, const mjData& data, int body, const PathOfBody& path_of_body = {}) {
  const std::string body_name = mj_id2name(&model, mjOBJ_BODY, body);
  const int text = mj_name2id(&model, mjOBJ_TEXT, body_name.c_str());
  if (text < 0) return {};
  if (model.body_mocapid[body] < 0) {
    throw std::runtime_error("body '" + body_name + "' has a path and so needs mocap=\"true\"");
  }
  const Eigen::Isometry3d T_world_body = body_pose(data, body);
  const double yaw_rad = std::atan2(T_world_body(1, 0), T_world_body(0, 0));
  try {
    return parse_path(model.text_data + model.text_adr[text], T_world_body.translation(), yaw_rad, path_of_body);
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error("the path of '" + body_name + "' " + error.what());
  }
}

/// An elliptic cylinder of the world.
struct WorldObject {
  std::string name;
  int geom = -1;
  int mocap = -1;  // -1: cannot move
  double rx_m = 0.0;
  double ry_m = 0.0;
  Path path;
};

WorldObject object_of(mjModel& model, const mjData& data, int geom) {
  const int body = model.geom_bodyid[geom];
  const std::string body_name = quoted_name(model, mjOBJ_BODY, body);
  const auto refuse = [&](const std::string& reason) {
    throw std::runtime_error("object " + body_name + " " + reason);
  };
  if (body == 0)
    throw std::runtime_error("geom " + quoted_name(model, mjOBJ_GEOM, geom) + " is an object without a body");
  if (mj_id2name(&model, mjOBJ_BODY, body) == nullptr) refuse("needs a name");
  if (model.geom_type[geom] != mjGEOM_ELLIPSOID) refuse("is not of type ellipsoid");

  const Eigen::Isometry3d T_world_body = body_pose(data, body);
  const Eigen::Isometry3d T_world_geom = isometry(data.geom_xpos + 3 * geom, data.geom_xmat + 9 * geom);
  if (!T_world_geom.isApprox(T_world_body, 1e-9)) refuse("has a geom with a pose of its own: put it on the body");
  if (T_world_geom(2, 2) < 1.0 - 1e-9) refuse("is not upright");

  WorldObject object;
  object.name = mj_id2name(&model, mjOBJ_BODY, body);
  object.geom = geom;
  object.mocap = model.body_mocapid[body];
  object.rx_m = model.geom_size[3 * geom];
  object.ry_m = model.geom_size[3 * geom + 1];
  object.path = path_of(model, data, body, [&](const std::string& other) -> Path {
    const int carrier = mj_name2id(&model, mjOBJ_BODY, other.c_str());
    return carrier < 0 ? Path() : path_of(model, data, carrier);
  });
  if (!object.path) {
    const double yaw_rad = std::atan2(T_world_body(1, 0), T_world_body(0, 0));
    object.path = parse_path("stand", T_world_body.translation(), yaw_rad);
  }
  model.geom_size[3 * geom + 2] = kHalfHeight_m;
  model.geom_rbound[geom] = kHalfHeight_m;
  return object;
}

/// The objects, in the order of the file.
std::vector<WorldObject> objects_of(mjModel& model, const mjData& data) {
  std::vector<WorldObject> objects;
  for (int geom = 0; geom < model.ngeom; ++geom) {  // MuJoCo sorts geoms by body
    if (model.geom_group[geom] != kObjectGroup) continue;
    objects.push_back(object_of(model, data, geom));
    if (objects.size() > 1 && objects[objects.size() - 2].name == objects.back().name) {
      throw std::runtime_error("object '" + objects.back().name + "' has more than one geom in group 1");
    }
  }
  return objects;
}

int robot_body(const mjModel& model) {
  const int robot = mj_name2id(&model, mjOBJ_BODY, "robot");
  if (robot < 0) throw std::runtime_error("there is no body 'robot'");
  if (model.body_mocapid[robot] < 0) throw std::runtime_error("body 'robot' needs mocap=\"true\"");
  for (int geom = 0; geom < model.ngeom; ++geom) {
    if (model.body_rootid[model.geom_bodyid[geom]] == robot && model.geom_group[geom] <= kObjectGroup) {
      throw std::runtime_error("geom " + quoted_name(model, mjOBJ_GEOM, geom) +
                               " of 'robot' needs group=\"2\", which the scanner does not see");
    }
  }
  return robot;
}

Eigen::Isometry3d lidar_mount(const mjModel& model, const mjData& data, int robot) {
  const int lidar = mj_name2id(&model, mjOBJ_SITE, "lidar");
  if (lidar < 0) throw std::runtime_error("there is no site 'lidar' on 'robot'");
  if (model.body_rootid[model.site_bodyid[lidar]] != robot) throw std::runtime_error("site 'lidar' is not on 'robot'");
  return body_pose(data, robot).inverse() * isometry(data.site_xpos + 3 * lidar, data.site_xmat + 9 * lidar);
}

void check_elements(const mjModel& model, const std::vector<WorldObject>& objects) {
  if (model.njnt > 0) {
    throw std::runtime_error("joint " + quoted_name(model, mjOBJ_JOINT, 0) +
                             " cannot move: things move on paths, by mocap bodies");
  }
  for (int text = 0; text < model.ntext; ++text) {
    const std::string name = mj_id2name(&model, mjOBJ_TEXT, text);
    const bool known = name == "robot" || std::any_of(objects.begin(), objects.end(),
                                                      [&](const WorldObject& object) { return object.name == name; });
    if (!known) throw std::runtime_error("text '" + name + "' is the path of no object");
  }
}

double robot_drag(const mjModel& model) {
  const int numeric = mj_name2id(&model, mjOBJ_NUMERIC, "robot_drag");
  if (numeric < 0) return 0.0;
  const double drag_1_s = model.numeric_data[model.numeric_adr[numeric]];
  if (!(drag_1_s >= 0.0 && drag_1_s <= 10.0)) throw std::runtime_error("numeric 'robot_drag' is outside [0, 10] 1/s");
  return drag_1_s;
}

/// One seed per scan, so that its noise depends on nothing else: SplitMix64 (Steele, Lea, Flood, 2014).
std::uint64_t seed_of_scan(std::uint64_t seed, std::uint64_t scan) {
  const auto mix = [](std::uint64_t z) {
    z += 0x9E3779B97F4A7C15U;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
    return z ^ (z >> 31);
  };
  return mix(mix(seed) + scan);
}

}  // namespace

void SimulatedLidarParams::validate() const {
  check_bounds(*this, "lidar");
  if (!(range_max_m > range_min_m)) throw std::invalid_argument("lidar.range_max_m must be above lidar.range_min_m");
  if (!(sweep_s < 1.0 / rate_hz)) throw std::invalid_argument("lidar.sweep_s must be below 1 / lidar.rate_hz");
  const std::string defect = scan_defect(static_cast<std::size_t>(beams), angle_min_rad, angle_increment_rad);
  if (!defect.empty()) throw std::invalid_argument("lidar.angle_increment_rad: " + defect);
}

class World::Impl {
 public:
  Impl(const std::string& mjcf_path, const SimulatedLidarParams& lidar, std::uint64_t seed) try
      : lidar_(lidar), seed_(seed), mujoco_(load(mjcf_path)) {
    mjModel& model = *mujoco_.model;
    const mjData& data = *mujoco_.data;
    objects_ = objects_of(model, data);
    sightings_.resize(objects_.size());
    object_of_geom_.assign(static_cast<std::size_t>(model.ngeom), kNoObject);
    for (std::size_t i = 0; i < objects_.size(); ++i) object_of_geom_[static_cast<std::size_t>(objects_[i].geom)] = i;

    const int robot = robot_body(model);
    robot_mocap_ = model.body_mocapid[robot];
    robot_at_rest_.T_world_robot = body_pose(data, robot);
    robot_path_ = path_of(model, data, robot);
    robot_drag_1_s_ = robot_drag(model);
    T_robot_lidar_ = lidar_mount(model, data, robot);
    check_elements(model, objects_);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(mjcf_path + ": " + error.what());
  }

  SimulatedScan next() {
    const double time_s = static_cast<double>(scans_) / lidar_.rate_hz;
    SimulatedScan out;
    out.robot = robot_at(time_s);
    out.T_world_lidar = out.robot.T_world_robot * T_robot_lidar_;
    out.T_world_lidar_end = robot_at(time_s + lidar_.sweep_s).T_world_robot * T_robot_lidar_;
    scan_from(time_s, out);
    ++scans_;
    out.truth = truth_at(time_s);
    for (const WorldObject& object : objects_) out.names.push_back(object.name);
    return out;
  }

  RobotState robot_at(double time_s) const {
    return robot_path_ ? multirotor_state(robot_path_(time_s), robot_drag_1_s_) : robot_at_rest_;
  }

  Objects truth_at(double time_s) const {
    Objects truth;
    truth.stamp_ns = nanoseconds(time_s);
    truth.height_world_m = (robot_at(time_s).T_world_robot * T_robot_lidar_).translation().z();
    for (std::size_t i = 0; i < objects_.size(); ++i) {
      const PathState state = objects_[i].path(time_s);
      Object object = sightings_[i];
      object.id = i + 1;
      object.ellipse_world = canonical({state.position_m.head<2>(), state.yaw_rad, objects_[i].rx_m, objects_[i].ry_m});
      object.velocity_world_m_s = state.velocity_m_s.head<2>();
      object.angular_velocity_rad_s = state.yaw_rate_rad_s;
      truth.objects.push_back(object);
    }
    return truth;
  }

  const Eigen::Isometry3d& T_robot_lidar() const { return T_robot_lidar_; }

 private:
  static constexpr std::size_t kNoObject = static_cast<std::size_t>(-1);

  void set_mocap(int mocap, const Eigen::Vector3d& position_world, const Eigen::Quaterniond& q_world) {
    Eigen::Map<Eigen::Vector3d>(mujoco_.data->mocap_pos + 3 * mocap) = position_world;
    Eigen::Map<Eigen::Vector4d>(mujoco_.data->mocap_quat + 4 * mocap) << q_world.w(), q_world.vec();
  }

  /// Returns where the lidar is then.
  Eigen::Isometry3d move_to(double time_s) {
    for (const WorldObject& object : objects_) {
      if (object.mocap < 0) continue;
      const PathState state = object.path(time_s);
      set_mocap(object.mocap, state.position_m,
                Eigen::Quaterniond(Eigen::AngleAxisd(state.yaw_rad, Eigen::Vector3d::UnitZ())));
    }
    const Eigen::Isometry3d T_world_robot = robot_at(time_s).T_world_robot;
    set_mocap(robot_mocap_, T_world_robot.translation(), Eigen::Quaterniond(T_world_robot.linear()));
    mj_kinematics(mujoco_.model.get(), mujoco_.data.get());
    return T_world_robot * T_robot_lidar_;
  }

  /// Scan the world as it moves from `start_s` on, and note in sightings_ what was hit.
  void scan_from(double start_s, SimulatedScan& out) {
    std::array<mjtByte, mjNGROUP> seen_groups{};
    seen_groups[kSceneryGroup] = seen_groups[kObjectGroup] = 1;
    const auto min_range_m = static_cast<float>(lidar_.range_min_m);
    const auto max_range_m = static_cast<float>(lidar_.range_max_m);
    Random noise(seed_of_scan(seed_, scans_));

    Scan& scan = out.scan;
    scan.stamp_ns = nanoseconds(start_s);
    scan.angle_min_rad = lidar_.angle_min_rad;
    scan.angle_increment_rad = lidar_.angle_increment_rad;
    scan.time_increment_s = lidar_.sweep_s / (lidar_.beams - 1);
    scan.beams.resize(static_cast<std::size_t>(lidar_.beams));
    out.object_of_beam.assign(scan.beams.size(), -1);
    for (Object& sighting : sightings_) sighting.beams = 0;
    Eigen::Isometry3d T_world_lidar = move_to(start_s);
    for (int i = 0; i < lidar_.beams; ++i) {
      if (i > 0 && scan.time_increment_s > 0.0) T_world_lidar = move_to(start_s + i * scan.time_increment_s);
      const Eigen::Vector3d origin_world = T_world_lidar.translation();
      const double angle_rad = lidar_.angle_min_rad + i * lidar_.angle_increment_rad;
      const Eigen::Vector3d beam_world =
          T_world_lidar.linear() * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0.0);
      int geom = -1;
      const double range_m = mj_ray(mujoco_.model.get(), mujoco_.data.get(), origin_world.data(), beam_world.data(),
                                    seen_groups.data(), /*flg_static=*/1, /*bodyexclude=*/-1, &geom);
      const double error_m = lidar_.range_sigma_m * noise.normal();  // one draw per beam, whatever it meets

      Beam& beam = scan.beams[static_cast<std::size_t>(i)];
      if (geom < 0 || range_m > lidar_.range_max_m) {
        beam.state = BeamState::kFree;
      } else if (range_m < lidar_.range_min_m) {
        beam.state = BeamState::kTooClose;
      } else {
        beam.state = BeamState::kHit;
        beam.range_m = std::clamp(static_cast<float>(range_m + error_m), min_range_m, max_range_m);
        const std::size_t object = object_of_geom_[static_cast<std::size_t>(geom)];
        if (object != kNoObject && range_m <= lidar_.truth_range_m) {
          ++sightings_[object].beams;
          out.object_of_beam[static_cast<std::size_t>(i)] = static_cast<int>(object);
        }
      }
    }
    for (Object& sighting : sightings_) {
      if (sighting.beams == 0) continue;
      if (sighting.observations++ == 0) sighting.first_seen_ns = scan.stamp_ns;
      sighting.last_seen_ns = scan.stamp_ns;
    }
  }

  SimulatedLidarParams lidar_;
  std::uint64_t seed_;
  Loaded mujoco_;
  std::vector<WorldObject> objects_;
  std::vector<Object> sightings_;  // what scans say of objects_, nothing else
  std::vector<std::size_t> object_of_geom_;
  int robot_mocap_ = -1;
  RobotState robot_at_rest_;  // where the robot is if it has no path
  Path robot_path_;
  double robot_drag_1_s_ = 0.0;
  Eigen::Isometry3d T_robot_lidar_;
  std::uint64_t scans_ = 0;
};

World::World(const std::string& mjcf_path, const SimulatedLidarParams& lidar, std::uint64_t seed) {
  lidar.validate();
  impl_ = std::make_unique<Impl>(mjcf_path, lidar, seed);
}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

SimulatedScan World::next() { return impl_->next(); }

RobotState World::robot_at(double time_s) const { return impl_->robot_at(time_s); }

Objects World::truth_at(double time_s) const { return impl_->truth_at(time_s); }

const Eigen::Isometry3d& World::T_robot_lidar() const { return impl_->T_robot_lidar(); }

}  // namespace situation_awareness
