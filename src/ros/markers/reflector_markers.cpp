// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/markers/reflector_markers.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "make_marker.hpp"

namespace situation_awareness {
namespace {

using visualization_msgs::Marker;

constexpr Color kUsedColor{0.2F, 0.75F, 0.3F};
constexpr Color kMissingColor{0.9F, 0.1F, 0.1F};
constexpr Color kMovedColor{0.97F, 0.55F, 0.04F};
constexpr Color kNotUsedColor{0.6F, 0.6F, 0.6F};
constexpr Color kUsedSightingColor{1.0F, 1.0F, 1.0F};
constexpr Color kAmbiguousSightingColor{0.95F, 0.85F, 0.1F};
constexpr Color kUnknownSightingColor{0.6F, 0.2F, 0.8F};

template <class List, class Is>
bool any(const List& list, Is is) {
  return std::any_of(list.begin(), list.end(), is);
}

Color color_of_reflector(int reflector, const ReflectorUpdate& update) {
  const auto is_it = [reflector](const auto& of) { return of.reflector == reflector; };
  if (any(update.moved, is_it)) return kMovedColor;
  if (any(update.missing, [reflector](int missing) { return missing == reflector; })) return kMissingColor;
  return any(update.matches, is_it) ? kUsedColor : kNotUsedColor;
}

Color color_of_sighting(std::size_t sighting, const ReflectorUpdate& update) {
  if (any(update.matches, [sighting](const auto& match) { return match.sighting == sighting; })) {
    return kUsedSightingColor;
  }
  const bool is_ambiguous = any(update.ambiguous, [sighting](std::size_t other) { return other == sighting; });
  return is_ambiguous ? kAmbiguousSightingColor : kUnknownSightingColor;
}

Marker upright(const std_msgs::Header& header, const char* name, std::size_t id, const Color& color,
               const Eigen::Vector2d& center_m, double radius_m, double height_m, float alpha) {
  Marker m = make_marker(header, name, id, Marker::CYLINDER, color, alpha);
  m.pose.position = make_point(center_m, 0.5 * height_m);
  m.scale.x = m.scale.y = 2.0 * radius_m;
  m.scale.z = height_m;
  return m;
}

Marker number_of(const std_msgs::Header& header, std::size_t id, const Eigen::Vector2d& center_m, double z_m) {
  Marker m = make_marker(header, "number", id, Marker::TEXT_VIEW_FACING, kInkColor, 1.0F);
  m.pose.position = make_point(center_m, z_m);
  m.scale.z = 0.2;
  m.text = std::to_string(id);
  return m;
}

Marker way_of(const std_msgs::Header& header, const MovedReflector& moved, const Eigen::Vector2d& known_m, double z_m) {
  Marker m =
      make_marker(header, "moved", static_cast<std::uint64_t>(moved.reflector), Marker::ARROW, kMovedColor, 1.0F);
  m.points = {make_point(known_m, z_m), make_point(moved.center_world_m, z_m)};
  m.scale.x = 0.03;
  m.scale.y = 0.08;
  m.scale.z = 0.08;
  return m;
}

}  // namespace

visualization_msgs::MarkerArray ReflectorMarkers::update(const LocalizationPipeline& pipeline,
                                                         const ReflectorUpdate& update,
                                                         const std::string& world_frame) {
  constexpr double kHeight_m = 0.6, kSightingHeight_m = 0.7, kSightingRadius_m = 0.02;
  const std_msgs::Header header = make_header(world_frame, update.stamp_ns);
  const std::vector<Reflector>& reflectors = pipeline.localization().map().reflectors;
  std::vector<Marker> markers;
  for (std::size_t i = 0; i < reflectors.size(); ++i) {
    const Reflector& reflector = reflectors[i];
    markers.push_back(upright(header, "reflector", i, color_of_reflector(static_cast<int>(i), update),
                              reflector.center_world_m, reflector.radius_m, kHeight_m, 0.7F));
    markers.push_back(number_of(header, i, reflector.center_world_m, kHeight_m + 0.2));
  }
  if (update.is_known) {
    for (const MovedReflector& moved : update.moved) {
      const auto i = static_cast<std::size_t>(moved.reflector);
      markers.push_back(way_of(header, moved, reflectors[i].center_world_m, kHeight_m));
    }
    const Pose2 T_world_level = pipeline.localization().pose().T_world_base.x * pipeline.T_base_level();
    const std::vector<ReflectorSighting>& sightings = pipeline.sightings().sightings;
    for (std::size_t i = 0; i < sightings.size(); ++i) {
      markers.push_back(upright(header, "sighting", i, color_of_sighting(i, update),
                                T_world_level * sightings[i].center_level_m, kSightingRadius_m, kSightingHeight_m,
                                1.0F));
    }
  }
  return shown_.update(header, std::move(markers));
}

}  // namespace situation_awareness
