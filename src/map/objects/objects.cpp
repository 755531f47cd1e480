// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/objects.hpp"

#include <utility>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/common/usual_room.hpp"

namespace situation_awareness {

const char* name_of(ObjectClass object_class) {
  switch (object_class) {
    case ObjectClass::kUnknown:
      return "unknown";
    case ObjectClass::kPerson:
      return "person";
    case ObjectClass::kVehicle:
      return "vehicle";
    case ObjectClass::kPole:
      return "pole";
  }
  return "";
}

std::vector<Eigen::Vector2d> outline_world(const Object& object) {
  if (object.shape != Shape::kBox) return points_on(object.ellipse_world, kOutlinePoints);
  const auto of_box = corners(object.box_world);
  return {of_box.begin(), of_box.end()};
}

std::vector<ExpectedOutline> outlines_at(std::int64_t stamp_ns, const Pose2& T_world_level, const Objects& map,
                                         double max_age_s, std::vector<ExpectedOutline> memory) {
  std::vector<ExpectedOutline> outlines_level = std::move(memory);
  outlines_level.clear();
  if (map.objects.empty()) return outlines_level;
  const double age_s = seconds_between(map.stamp_ns, stamp_ns);
  if (age_s < 0.0 || age_s > max_age_s) return outlines_level;
  const Pose2 T_level_world = inverse(T_world_level);
  const Eigen::Matrix2d R_level_world = T_level_world.rotation();
  const auto to_level = [&](auto& outline) {
    const Eigen::Vector2d center_level_m = R_level_world * outline.center_m + T_level_world.translation_m;
    outline.center_m = center_level_m;
    outline.psi_rad = T_level_world.yaw_rad + outline.psi_rad;
  };
  make_room(outlines_level, map.objects.size());
  for (const Object& object : map.objects) {
    if (object.object_class == ObjectClass::kPerson) continue;  // its legs have other outlines
    ExpectedOutline expected;
    expected.id = object.id;
    expected.ellipse = object.ellipse_world;
    expected.box = object.box_world;
    expected.p_box = object.shape == Shape::kBox ? object.p_shape : 1.0 - object.p_shape;
    expected.velocity_m_s = object.velocity_world_m_s;
    expected.angular_velocity_rad_s = object.angular_velocity_rad_s;
    expected = later(expected, age_s);
    to_level(expected.ellipse);
    to_level(expected.box);
    expected.velocity_m_s = R_level_world * object.velocity_world_m_s;
    outlines_level.push_back(expected);
  }
  return outlines_level;
}

}  // namespace situation_awareness
