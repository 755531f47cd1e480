// SPDX-License-Identifier: BSD-3-Clause
#include "world_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "flight.hpp"
#include "mesh_section.hpp"
#include "named_values.hpp"

namespace situation_awareness {
namespace {

std::mutex& mujoco_mutex() {
  static std::mutex mutex;
  return mutex;
}

void throw_text(const char* text) { throw std::runtime_error(text); }

/// MuJoCo's message, on one line.
std::string one_line(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

/// The compiled file, with bodies at their poses of the file.
std::pair<ModelPtr, DataPtr> load(const std::string& mjcf_path) try {
  const MujocoThrows guard;
  std::array<char, 1000> complaint{};
  ModelPtr model(mj_loadXML(mjcf_path.c_str(), nullptr, complaint.data(), static_cast<int>(complaint.size())));
  if (!model || complaint[0] != '\0') throw std::runtime_error(complaint.data());
  // No collisions: bodies on paths move through others.
  model->opt.disableflags |= mjDSBL_CONTACT;
  DataPtr data(mj_makeData(model.get()));
  if (!data) throw std::runtime_error("not enough memory for its data");
  mj_kinematics(model.get(), data.get());
  return {std::move(model), std::move(data)};
} catch (const std::runtime_error& error) {
  throw std::runtime_error("MuJoCo refuses it: " + one_line(error.what()));
}

Eigen::Isometry3d isometry(const mjtNum* position, const mjtNum* rotation) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = Eigen::Map<const Eigen::Vector3d>(position);
  T.linear() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation);
  return T;
}

/// The path in the <text> with the body's name; empty without one.
ScriptedPath path_of(const mjModel& model, const mjData& data, int body, const PathOfBody& path_of_body = {}) {
  const std::string body_name = mj_id2name(&model, mjOBJ_BODY, body);
  const int text = mj_name2id(&model, mjOBJ_TEXT, body_name.c_str());
  if (text < 0) return {};
  const Eigen::Isometry3d T_world_body = body_pose(data, body);
  const double yaw_rad = std::atan2(T_world_body(1, 0), T_world_body(0, 0));
  try {
    const std::string words = model.text_data + model.text_adr[text];
    const PathFacts facts = facts_of_path(words);
    if (body_name == "robot") {
      if (!facts.presence.always())
        throw std::invalid_argument("has 'appears', 'goes' or 'transits': the robot is always there");
    } else if (model.body_mocapid[body] < 0 && (!facts.stands || facts.presence.always())) {
      throw std::runtime_error("body '" + body_name + "' has a path and so needs mocap=\"true\"");
    }
    return parse_path(words, T_world_body.translation(), yaw_rad, path_of_body);
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error("the path of '" + body_name + "' " + error.what());
  }
}

/// Presence of the body by its text, and for one that moves with another at most that one's.
Presence presence_of(const mjModel& model, const std::string& body_name) {
  const int text = mj_name2id(&model, mjOBJ_TEXT, body_name.c_str());
  if (text < 0) return {};
  try {
    PathFacts facts = facts_of_path(model.text_data + model.text_adr[text]);
    if (facts.carrier.empty()) return facts.presence;
    const Presence of_carrier = presence_of(model, facts.carrier);
    facts.presence.appears_s = std::max(facts.presence.appears_s, of_carrier.appears_s);
    facts.presence.goes_s = std::min(facts.presence.goes_s, of_carrier.goes_s);
    if (of_carrier.transits) {
      std::vector<int> both;
      for (const int transit : *of_carrier.transits) {
        if (facts.presence.in(transit)) both.push_back(transit);
      }
      facts.presence.transits = std::move(both);
    }
    return facts.presence;
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error("the path of '" + body_name + "' " + error.what());
  }
}

/// Finds the paths that others may move `with`.
PathOfBody any_path(const mjModel& model, const mjData& data) {
  return [&](const std::string& other) -> ScriptedPath {
    const int carrier = mj_name2id(&model, mjOBJ_BODY, other.c_str());
    return carrier < 0 ? ScriptedPath() : path_of(model, data, carrier);
  };
}

/// The path of a body, which without one stands where it is in the file.
ScriptedPath path_or_place(const mjModel& model, const mjData& data, int body) {
  if (ScriptedPath path = path_of(model, data, body, any_path(model, data))) return path;
  const Eigen::Isometry3d T = body_pose(data, body);
  return parse_path("stand", T.translation(), std::atan2(T(1, 0), T(0, 0)));
}

/// The triangles of a mesh in the frame of its body.
TriangleMesh mesh_of(const mjModel& model, int geom, const Eigen::Isometry3d& T_body_geom) {
  const int id = model.geom_dataid[geom];
  TriangleMesh mesh;
  for (int i = 0; i < model.mesh_vertnum[id]; ++i) {
    const Eigen::Map<const Eigen::Vector3f> p_geom(model.mesh_vert + 3 * (model.mesh_vertadr[id] + i));
    mesh.vertices_m.push_back(T_body_geom * p_geom.cast<double>());
  }
  for (int i = 0; i < model.mesh_facenum[id]; ++i) {
    const int* const corners = model.mesh_face + 3 * (model.mesh_faceadr[id] + i);
    mesh.triangles.push_back({corners[0], corners[1], corners[2]});
  }
  return mesh;
}

WorldObject object_of(const mjModel& model, const mjData& data, int geom) {
  const int body = model.geom_bodyid[geom];
  const std::string body_name = quoted_name(model, mjOBJ_BODY, body);
  const auto refuse = [&](const std::string& reason) {
    throw std::runtime_error("object " + body_name + " " + reason);
  };
  if (body == 0)
    throw std::runtime_error("geom " + quoted_name(model, mjOBJ_GEOM, geom) + " is an object without a body");
  if (mj_id2name(&model, mjOBJ_BODY, body) == nullptr) refuse("needs a name");
  const int type = model.geom_type[geom];
  if (type != mjGEOM_ELLIPSOID && type != mjGEOM_BOX && type != mjGEOM_MESH) {
    refuse("is not of type ellipsoid, box or mesh");
  }
  const Eigen::Isometry3d T_world_body = body_pose(data, body);
  const Eigen::Isometry3d T_world_geom = isometry(data.geom_xpos + 3 * geom, data.geom_xmat + 9 * geom);
  // MuJoCo gives every mesh the axes of its own inertia.
  if (type != mjGEOM_MESH && !T_world_geom.isApprox(T_world_body, 1e-9)) {
    refuse("has a geom with its own pose: put it on the body");
  }
  if (T_world_body(2, 2) < 1.0 - 1e-9) refuse("is not upright");

  WorldObject object;
  object.name = mj_id2name(&model, mjOBJ_BODY, body);
  object.geom = geom;
  object.mocap = model.body_mocapid[body];
  if (type == mjGEOM_ELLIPSOID) {
    object.rx_m = model.geom_size[3 * geom];
    object.ry_m = model.geom_size[3 * geom + 1];
  } else if (type == mjGEOM_BOX) {
    const Eigen::Vector2d half_m(model.geom_size[3 * geom], model.geom_size[3 * geom + 1]);
    object.footprint_m = {-half_m, {half_m.x(), -half_m.y()}, half_m, {-half_m.x(), half_m.y()}};
  } else {
    try {
      object.footprint_m = section_at_half_height(mesh_of(model, geom, T_world_body.inverse() * T_world_geom));
    } catch (const std::invalid_argument& error) {
      refuse(error.what());
    }
  }
  object.path = path_or_place(model, data, body);
  object.presence = presence_of(model, object.name);
  return object;
}

/// The objects, in the order of the file.
std::vector<WorldObject> objects_of(const mjModel& model, const mjData& data) {
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

/// The objects, those named THING/PART as parts of THING, in the order of the first parts.
std::vector<WorldThing> things_of(const mjModel& model, const mjData& data, const std::vector<WorldObject>& objects) {
  std::vector<WorldThing> things;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const std::string name = objects[i].name.substr(0, objects[i].name.rfind('/'));
    const auto known =
        std::find_if(things.begin(), things.end(), [&name](const WorldThing& thing) { return thing.name == name; });
    if (known != things.end()) {
      known->parts.push_back(i);
      continue;
    }
    const int body = mj_name2id(&model, mjOBJ_BODY, name.c_str());
    things.push_back({name, {i}, body < 0 ? objects[i].path : path_or_place(model, data, body)});
  }
  return things;
}

bool has_free_joint(const mjModel& model, int body) {
  return model.body_jntnum[body] == 1 && model.jnt_type[model.body_jntadr[body]] == mjJNT_FREE;
}

int robot_body(const mjModel& model) {
  const int robot = mj_name2id(&model, mjOBJ_BODY, "robot");
  if (robot < 0) throw std::runtime_error("there is no body 'robot'");
  if (model.body_mocapid[robot] < 0 && !has_free_joint(model, robot)) {
    throw std::runtime_error(
        "body 'robot' needs mocap=\"true\" to follow its path exactly, or <freejoint/> and motors");
  }
  for (int geom = 0; geom < model.ngeom; ++geom) {
    if (model.body_rootid[model.geom_bodyid[geom]] == robot && model.geom_group[geom] <= kObjectGroup) {
      throw std::runtime_error("geom " + quoted_name(model, mjOBJ_GEOM, geom) +
                               " of 'robot' needs group=\"2\", which the scanner does not see");
    }
  }
  return robot;
}

/// The sites of the robot that a text describes, and the site `lidar`, which needs none.
std::vector<SensorMount> mounts_of(const mjModel& model, const mjData& data, int robot) {
  std::vector<SensorMount> mounts;
  for (int site = 0; site < model.nsite; ++site) {
    const char* const name = mj_id2name(&model, mjOBJ_SITE, site);
    if (name == nullptr) continue;
    const int text = mj_name2id(&model, mjOBJ_TEXT, name);
    const std::string quoted = quoted_name(model, mjOBJ_SITE, site);
    if (text < 0 && quoted != "'lidar'") continue;
    if (model.body_rootid[model.site_bodyid[site]] != robot) {
      throw std::runtime_error("site " + quoted + " is not on 'robot'");
    }
    if (text >= 0 && mj_name2id(&model, mjOBJ_BODY, name) >= 0) {
      throw std::runtime_error("text " + quoted + " is ambiguous: a body and a site have this name");
    }
    mounts.push_back(
        {name, text < 0 ? "" : model.text_data + model.text_adr[text],
         body_pose(data, robot).inverse() * isometry(data.site_xpos + 3 * site, data.site_xmat + 9 * site)});
  }
  return mounts;
}

/// The bodies that are not always present, with everything mounted on them.
std::vector<WorldVisitor> visitors_of(const mjModel& model) {
  std::vector<WorldVisitor> visitors;
  for (int body = 1; body < model.nbody; ++body) {
    const char* const name = mj_id2name(&model, mjOBJ_BODY, body);
    if (name == nullptr) continue;
    WorldVisitor visitor;
    visitor.presence = presence_of(model, name);
    if (visitor.presence.always()) continue;
    for (int geom = 0; geom < model.ngeom; ++geom) {
      if (model.body_rootid[model.geom_bodyid[geom]] != body) continue;
      visitor.geoms.push_back(geom);
      visitor.groups.push_back(model.geom_group[geom]);
    }
    visitors.push_back(std::move(visitor));
  }
  return visitors;
}

/// The bodies that move on paths and are invisible to the scanner.
std::vector<WorldDecoration> decorations_of(const mjModel& model, const mjData& data, int robot) {
  std::vector<WorldDecoration> decorations;
  for (int body = 1; body < model.nbody; ++body) {
    const char* const name = mj_id2name(&model, mjOBJ_BODY, body);
    if (body == robot || name == nullptr || mj_name2id(&model, mjOBJ_TEXT, name) < 0) continue;
    bool is_object = false, is_scenery = false;
    for (int geom = 0; geom < model.ngeom; ++geom) {
      if (model.body_rootid[model.geom_bodyid[geom]] != body) continue;
      is_object = is_object || model.geom_group[geom] == kObjectGroup;
      is_scenery = is_scenery || model.geom_group[geom] == kSceneryGroup;
    }
    if (is_scenery && model.body_mocapid[body] >= 0) {
      throw std::runtime_error("body '" + std::string(name) + "' moves and has a geom in group 0, where nothing does");
    }
    if (is_object) continue;
    const ScriptedPath path = path_of(model, data, body, any_path(model, data));
    if (model.body_mocapid[body] >= 0) decorations.push_back({model.body_mocapid[body], path});
  }
  return decorations;
}

void check_elements(const mjModel& model, int robot) {
  for (int joint = 0; joint < model.njnt; ++joint) {
    if (model.jnt_bodyid[joint] == robot) continue;
    throw std::runtime_error("joint " + quoted_name(model, mjOBJ_JOINT, joint) +
                             " cannot move: things move on paths, by mocap bodies");
  }
  if (model.njnt == 0 && model.nu > 0) {
    throw std::runtime_error("motor " + quoted_name(model, mjOBJ_ACTUATOR, 0) +
                             " has nothing to move: 'robot' has no free joint");
  }
  for (int text = 0; text < model.ntext; ++text) {
    const std::string name = mj_id2name(&model, mjOBJ_TEXT, text);
    const bool known =
        mj_name2id(&model, mjOBJ_BODY, name.c_str()) >= 0 || mj_name2id(&model, mjOBJ_SITE, name.c_str()) >= 0;
    if (!known) throw std::runtime_error("text '" + name + "' is the path of no body, and no site has that name");
  }
}

double robot_drag(const mjModel& model) {
  const int numeric = mj_name2id(&model, mjOBJ_NUMERIC, "robot_drag");
  if (numeric < 0) return 0.0;
  const double drag_1_s = model.numeric_data[model.numeric_adr[numeric]];
  if (!(drag_1_s >= 0.0 && drag_1_s <= 10.0)) throw std::runtime_error("numeric 'robot_drag' is outside [0, 10] 1/s");
  return drag_1_s;
}

std::optional<WorldOrigin> origin_of(const mjModel& model) {
  const int numeric = mj_name2id(&model, mjOBJ_NUMERIC, "world_origin");
  if (numeric < 0) return std::nullopt;
  if (model.numeric_size[numeric] != 3) {
    throw std::runtime_error("numeric 'world_origin' needs 3 numbers: latitude and longitude in deg, altitude in m");
  }
  const double* const data = model.numeric_data + model.numeric_adr[numeric];
  const auto check = [](double value, double bound, const char* what) {
    if (std::abs(value) <= bound) return value;
    std::ostringstream sentence;
    sentence << "numeric 'world_origin': " << what << " = " << value << " is outside [-" << bound << ", " << bound
             << "]";
    throw std::runtime_error(sentence.str());
  };
  return WorldOrigin{check(data[0], 90.0, "latitude"), check(data[1], 180.0, "longitude"),
                     check(data[2], 20000.0, "altitude")};
}

std::vector<Box> fixtures_of(const mjModel& model, const mjData& data) {
  const std::string prefix = "fixture/";
  std::vector<Box> fixtures;
  for (int geom = 0; geom < model.ngeom; ++geom) {
    const char* const name = mj_id2name(&model, mjOBJ_GEOM, geom);
    if (name == nullptr || std::string(name).compare(0, prefix.size(), prefix) != 0) continue;
    const Eigen::Isometry3d T_world_geom = isometry(data.geom_xpos + 3 * geom, data.geom_xmat + 9 * geom);
    const Eigen::Vector3d x_axis = T_world_geom.linear().col(0);
    if (model.geom_bodyid[geom] != 0 || model.geom_type[geom] != mjGEOM_BOX || std::abs(x_axis.z()) > 1e-6 ||
        std::abs(T_world_geom.linear()(2, 2)) < 1.0 - 1e-6) {
      throw std::runtime_error("geom " + quoted_name(model, mjOBJ_GEOM, geom) +
                               " needs type=\"box\", upright in the world body: a fixture stands");
    }
    const mjtNum* const half_m = model.geom_size + 3 * geom;
    fixtures.push_back(
        {T_world_geom.translation().head<2>(), std::atan2(x_axis.y(), x_axis.x()), half_m[0], half_m[1]});
  }
  return fixtures;
}

/// The parameters in the text of a robot that is a vehicle of this kind; nothing for others.
template <class Params>
std::optional<Params> vehicle_of(const mjModel& model, int robot, const std::string& vehicle_kind) {
  const int text = mj_name2id(&model, mjOBJ_TEXT, "robot");
  if (text < 0) return std::nullopt;
  std::istringstream words(model.text_data + model.text_adr[text]);
  std::string kind;
  if (!(words >> kind) || kind != vehicle_kind) return std::nullopt;
  try {
    if (model.body_mocapid[robot] < 0) throw std::invalid_argument("needs mocap=\"true\"");
    NamedValues values(words);
    Params params;
    Params::fields(params, values);
    values.check_all_used();
    params.validate();
    return params;
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error("the vehicle 'robot' " + std::string(error.what()));
  }
}

std::vector<Eigen::Vector2d> docks_of(const mjModel& model) {
  const int numeric = mj_name2id(&model, mjOBJ_NUMERIC, "docks");
  if (numeric < 0) return {};
  const int size = model.numeric_size[numeric];
  if (size != 2 && size != 4) throw std::runtime_error("numeric 'docks' needs x y of one place or of two, in m");
  std::vector<Eigen::Vector2d> docks;
  for (int i = 0; i < size; i += 2)
    docks.emplace_back(Eigen::Map<const Eigen::Vector2d>(model.numeric_data + model.numeric_adr[numeric] + i));
  return docks;
}

std::vector<Eigen::Vector3d> rounds_of(const mjModel& model) {
  const int numeric = mj_name2id(&model, mjOBJ_NUMERIC, "rounds");
  if (numeric < 0) return {};
  const int size = model.numeric_size[numeric];
  if (size % 3 != 0) throw std::runtime_error("numeric 'rounds' needs x y and radius of each circle, in m");
  std::vector<Eigen::Vector3d> rounds;
  for (int i = 0; i < size; i += 3) {
    rounds.emplace_back(Eigen::Map<const Eigen::Vector3d>(model.numeric_data + model.numeric_adr[numeric] + i));
    if (!(rounds.back().z() > 0.0)) throw std::runtime_error("numeric 'rounds' has a radius that is not above 0");
  }
  return rounds;
}

/// The outlines of what a scanner may hit. `objects` are those of the file.
std::vector<WorldOutline> outlines_of(const mjModel& model, const mjData& data,
                                      const std::vector<WorldObject>& objects) {
  constexpr int kCylinderSides = 96;
  std::vector<WorldOutline> outlines;
  for (int geom = 0; geom < model.ngeom; ++geom) {
    const int group = model.geom_group[geom], type = model.geom_type[geom], body = model.geom_bodyid[geom];
    if (group != kSceneryGroup && group != kObjectGroup) continue;
    const char* const name = mj_id2name(&model, body > 0 ? mjOBJ_BODY : mjOBJ_GEOM, body > 0 ? body : geom);
    WorldOutline outline;
    outline.thing = name == nullptr ? "scenery" : std::string(name);
    outline.thing.resize(std::min(outline.thing.size(), outline.thing.rfind('/')));
    outline.can_move = model.body_mocapid[body] >= 0;
    const Eigen::Isometry3d T = isometry(data.geom_xpos + 3 * geom, data.geom_xmat + 9 * geom);
    const Eigen::Vector3d half_m = Eigen::Map<const Eigen::Vector3d>(model.geom_size + 3 * geom);
    if (group == kObjectGroup) {
      const auto object =
          std::find_if(objects.begin(), objects.end(), [geom](const WorldObject& o) { return o.geom == geom; });
      outline.object = static_cast<int>(object - objects.begin());
      outline.presence = object->presence;
      const bool is_box = type == mjGEOM_BOX;  // others have any height
      outline.bottom_m = is_box ? T.translation().z() - half_m.z() : -std::numeric_limits<double>::infinity();
      outline.top_m = is_box ? T.translation().z() + half_m.z() : std::numeric_limits<double>::infinity();
    } else {
      if ((type != mjGEOM_BOX && type != mjGEOM_CYLINDER) || std::abs(T(2, 2)) < 1.0 - 1e-9) continue;
      const double half_height_m = type == mjGEOM_BOX ? half_m.z() : half_m.y();
      outline.bottom_m = T.translation().z() - half_height_m;
      outline.top_m = T.translation().z() + half_height_m;
      if (type == mjGEOM_BOX) {
        const Eigen::Vector2d corner_m = half_m.head<2>();
        const double yaw_rad = std::atan2(T(1, 0), T(0, 0));
        for (const Eigen::Vector2d& p : {Eigen::Vector2d(-corner_m), Eigen::Vector2d(corner_m.x(), -corner_m.y()),
                                         corner_m, Eigen::Vector2d(-corner_m.x(), corner_m.y())}) {
          outline.points_world_m.push_back(T.translation().head<2>() + Eigen::Rotation2Dd(yaw_rad) * p);
        }
      } else {
        outline.points_world_m =
            points_on(Ellipse{T.translation().head<2>(), 0.0, half_m.x(), half_m.x()}, kCylinderSides);
      }
      if (body > 0 && name != nullptr) outline.presence = presence_of(model, name);
    }
    outlines.push_back(std::move(outline));
  }
  return outlines;
}

}  // namespace

MujocoThrows::MujocoThrows() : lock_(mujoco_mutex()), error_(mju_user_error), warning_(mju_user_warning) {
  mju_user_error = throw_text;
  mju_user_warning = throw_text;
}

MujocoThrows::~MujocoThrows() {
  mju_user_error = error_;
  mju_user_warning = warning_;
}

Eigen::Isometry3d body_pose(const mjData& data, int body) {
  return isometry(data.xpos + 3 * body, data.xmat + 9 * body);
}

std::string quoted_name(const mjModel& model, mjtObj type, int id) {
  const char* const name = mj_id2name(&model, type, id);
  return name != nullptr ? "'" + std::string(name) + "'" : "number " + std::to_string(id) + " (without a name)";
}

WorldModel::WorldModel(const std::string& mjcf_path) try {
  std::tie(model_, data_) = load(mjcf_path);
  objects_ = objects_of(*model_, *data_);
  for (const WorldObject& object : objects_) names_.push_back(object.name);
  things_ = things_of(*model_, *data_, objects_);
  robot_ = robot_body(*model_);
  robot_at_rest_.T_world_robot = body_pose(*data_, robot_);
  const auto vehicle = vehicle_of<UnicycleParams>(*model_, robot_, "unicycle");
  const auto aircraft = vehicle_of<FixedWingParams>(*model_, robot_, "fixed_wing");
  const auto multirotor = vehicle_of<GuidedMultirotorParams>(*model_, robot_, "multirotor");
  if (vehicle || aircraft || multirotor) {
    const Eigen::Isometry3d& T = robot_at_rest_.T_world_robot;
    if (T(2, 2) < 1.0 - 1e-9) throw std::runtime_error("the vehicle 'robot' is not upright");
    const Pose2 T_world_robot{T.translation().head<2>(), std::atan2(T(1, 0), T(0, 0))};
    if (vehicle) vehicle_ = std::make_unique<Unicycle>(*vehicle, T_world_robot);
    if (aircraft) aircraft_ = std::make_unique<FixedWing>(*aircraft, T_world_robot, T.translation().z());
    if (multirotor) {
      multirotor_ = std::make_unique<GuidedMultirotor>(*multirotor, T.translation(), T_world_robot.yaw_rad);
    }
  } else {
    robot_path_ = path_of(*model_, *data_, robot_);
  }
  docks_ = docks_of(*model_);
  rounds_ = rounds_of(*model_);
  robot_drag_1_s_ = robot_drag(*model_);
  mounts_ = mounts_of(*model_, *data_, robot_);
  origin_ = origin_of(*model_);
  fixtures_ = fixtures_of(*model_, *data_);
  decorations_ = decorations_of(*model_, *data_, robot_);
  visitors_ = visitors_of(*model_);
  outlines_ = outlines_of(*model_, *data_, objects_);
  check_elements(*model_, robot_);
  if (model_->body_mocapid[robot_] < 0) {
    const Eigen::Isometry3d& T = robot_at_rest_.T_world_robot;
    ScriptedPath path = robot_path_ ? robot_path_ : parse_path("stand", T.translation(), std::atan2(T(1, 0), T(0, 0)));
    flight_ = std::make_unique<Flight>(*model_, robot_, std::move(path), robot_drag_1_s_);
  }
} catch (const std::runtime_error& error) {
  throw std::runtime_error(mjcf_path + ": " + error.what());
}

WorldModel::~WorldModel() = default;

RobotState WorldModel::robot_at(double time_s) const {
  if (flight_) return flight_->at(time_s);
  if (aircraft_) return aircraft_->at(time_s);
  if (multirotor_) return multirotor_->at(time_s);
  if (vehicle_) {
    const UnicycleState state = vehicle_->at(time_s);
    const double yaw_rad = state.T_world_robot.yaw_rad;
    RobotState robot;
    robot.T_world_robot.linear() = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    robot.T_world_robot.translation() << state.T_world_robot.translation_m,
        robot_at_rest_.T_world_robot.translation().z();
    robot.velocity_world_m_s << state.speed_m_s * std::cos(yaw_rad), state.speed_m_s * std::sin(yaw_rad), 0.0;
    robot.angular_velocity_robot_rad_s.z() = state.yaw_rate_rad_s;
    return robot;
  }
  return robot_path_ ? multirotor_state(robot_path_(time_s), robot_drag_1_s_) : robot_at_rest_;
}

void WorldModel::set_mocap(int mocap, const Eigen::Vector3d& position_world, const Eigen::Quaterniond& q_world) {
  Eigen::Map<Eigen::Vector3d>(data_->mocap_pos + 3 * mocap) = position_world;
  Eigen::Map<Eigen::Vector4d>(data_->mocap_quat + 4 * mocap) << q_world.w(), q_world.vec();
}

void WorldModel::move_along(int mocap, const ScriptedPath& path, double time_s) {
  const PathState state = path(time_of_transit(time_s));
  set_mocap(mocap, state.position_m, Eigen::Quaterniond(Eigen::AngleAxisd(state.yaw_rad, Eigen::Vector3d::UnitZ())));
}

void WorldModel::show_those_there(double time_s) {
  for (const WorldVisitor& visitor : visitors_) {
    const bool there = is_there(visitor.presence, time_s);
    for (std::size_t i = 0; i < visitor.geoms.size(); ++i) {
      model_->geom_group[visitor.geoms[i]] = there ? visitor.groups[i] : kAbsentGroup;
    }
  }
}

void WorldModel::place(double time_s, const Eigen::Isometry3d& T_world_robot) {
  for (const WorldObject& object : objects_) {
    if (object.mocap >= 0) move_along(object.mocap, object.path, time_s);
  }
  show_those_there(time_s);
  const Eigen::Quaterniond q_world_robot(T_world_robot.linear());
  if (flight_) {
    Eigen::Map<Eigen::Vector3d>(data_->qpos) = T_world_robot.translation();
    Eigen::Map<Eigen::Vector4d>(data_->qpos + 3) << q_world_robot.w(), q_world_robot.vec();
  } else {
    set_mocap(model_->body_mocapid[robot_], T_world_robot.translation(), q_world_robot);
  }
  mj_kinematics(model_.get(), data_.get());
}

void WorldModel::place_decorations(double time_s) {
  for (const WorldDecoration& decoration : decorations_) move_along(decoration.mocap, decoration.path, time_s);
  mj_kinematics(model_.get(), data_.get());
}

}  // namespace situation_awareness
