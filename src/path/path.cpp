// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/path.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <stdexcept>

#include <yaml-cpp/yaml.h>

#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/yaml_defect.hpp"

namespace situation_awareness {
namespace {

constexpr Bounds kPlace{-1e6, 1e6};
constexpr double kMostSpeed_m_s = 100.0;
constexpr double kMostWay_m = 1000.0;
constexpr std::size_t kMostWayPoints = 10'000;
constexpr std::array<const char*, 3> kWayPointKeys = {"x", "y", "speed_m_s"};

[[noreturn]] void refuse_path(const std::string& source, const std::string& reason) {
  throw std::invalid_argument(source + ": " + reason);
}

std::string way_point_name(std::size_t i) { return "path[" + std::to_string(i) + ']'; }

double way_point_number(const YAML::Node& value, const char* key, std::size_t i, const std::string& source) {
  double number = 0.0;
  if (!value.IsScalar() || !YAML::convert<double>::decode(value, number)) {
    refuse_path(source, way_point_name(i) + '.' + key + " must be a number");
  }
  return number;
}

WayPoint way_point_of(const YAML::Node& node, std::size_t i, const std::string& source) {
  if (!node.IsMap()) refuse_path(source, way_point_name(i) + " must be a map of x, y and maybe speed_m_s");
  std::array<int, kWayPointKeys.size()> given{};
  for (const auto& item : node) {
    const std::string key = item.first.IsScalar() ? item.first.Scalar() : "";
    const auto known = std::find(kWayPointKeys.begin(), kWayPointKeys.end(), key);
    if (known == kWayPointKeys.end()) {
      refuse_path(source, way_point_name(i) + " has the unknown key " + yaml_text(key));
    }
    if (++given[static_cast<std::size_t>(known - kWayPointKeys.begin())] > 1) {
      refuse_path(source, way_point_name(i) + '.' + key + " is given twice");
    }
  }
  WayPoint point;
  for (const int axis : {0, 1}) {
    const auto key = kWayPointKeys[static_cast<std::size_t>(axis)];
    const YAML::Node value = node[key];
    if (!value.IsDefined()) refuse_path(source, way_point_name(i) + '.' + key + " is missing");
    point.p_world_m(axis) = way_point_number(value, key, i, source);
  }
  const YAML::Node speed = node["speed_m_s"];
  if (speed.IsDefined()) point.speed_m_s = way_point_number(speed, "speed_m_s", i, source);
  return point;
}

}  // namespace

void check_path(const Path& path, const std::string& source) {
  const std::size_t count = path.way_points.size();
  const std::size_t least = path.closed ? 3 : 2;
  if (count < least || count > kMostWayPoints) {
    refuse_path(source, "path must have from " + std::to_string(least) + " to " + std::to_string(kMostWayPoints) +
                            " way points" + (path.closed ? " if it is closed" : "") + ", not " + std::to_string(count));
  }
  for (std::size_t i = 0; i < count; ++i) {
    const WayPoint& point = path.way_points[i];
    for (const int axis : {0, 1}) {
      const double value = point.p_world_m(axis);
      if (value >= kPlace.low && value <= kPlace.high) continue;  // false for NaN
      refuse_path(source, way_point_name(i) + '.' + kWayPointKeys[static_cast<std::size_t>(axis)] + " = " +
                              yaml_text(value) + " is outside " + text_of(kPlace, "m"));
    }
    if (point.speed_m_s && !(*point.speed_m_s > 0.0 && *point.speed_m_s <= kMostSpeed_m_s)) {
      refuse_path(source,
                  way_point_name(i) + ".speed_m_s = " + yaml_text(*point.speed_m_s) + " is outside (0, 100] m/s");
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t next = i + 1 < count ? i + 1 : 0;
    if (next == 0 && !path.closed) break;
    const double way_m = (path.way_points[next].p_world_m - path.way_points[i].p_world_m).norm();
    if (way_m >= kLeastWay_m && way_m <= kMostWay_m) continue;
    refuse_path(source, way_point_name(i) + " and " + way_point_name(next) + " are " + yaml_text(way_m) +
                            " m apart, which is outside " + text_of({kLeastWay_m, kMostWay_m}, "m"));
  }
}

Path read_path(const std::string& yaml, const std::string& source) {
  YAML::Node root;
  try {
    root = YAML::Load(yaml);
  } catch (const YAML::Exception& error) {
    refuse_path(source, yaml_defect(error));
  }
  if (!root.IsMap() || !root["path"].IsDefined()) refuse_path(source, "must be a map with the key path");
  Path path;
  const YAML::Node closed = root["closed"];
  if (closed.IsDefined() && !YAML::convert<bool>::decode(closed, path.closed)) {
    refuse_path(source, "closed must be true or false");
  }
  if (root.size() != (closed.IsDefined() ? 2U : 1U)) refuse_path(source, "may have the keys path and closed alone");
  const YAML::Node list = root["path"];
  if (!list.IsSequence()) refuse_path(source, "path must be a list of way points");
  if (list.size() > kMostWayPoints) {
    refuse_path(source, "path has more than " + std::to_string(kMostWayPoints) + " way points");
  }
  for (const YAML::Node& node : list) path.way_points.push_back(way_point_of(node, path.way_points.size(), source));
  check_path(path, source);
  return path;
}

Path load_path(const std::string& file) { return read_path(read_text_file(file), file); }

std::string yaml_text(const Path& path) {
  std::string text = path.closed ? "closed: true\npath:\n" : "path:\n";
  for (const WayPoint& point : path.way_points) {
    text += "  - {x: " + yaml_text(point.p_world_m.x()) + ", y: " + yaml_text(point.p_world_m.y());
    if (point.speed_m_s) text += ", speed_m_s: " + yaml_text(*point.speed_m_s);
    text += "}\n";
  }
  return text;
}

Path reversed(const Path& path) {
  const std::size_t count = path.way_points.size();
  Path back{path.closed, {}};
  // Of each segment, which the way back enters at its other end; without a limit is what nothing is as fast as.
  std::vector<std::optional<double>> speeds(count);
  const bool any = std::any_of(path.way_points.begin(), path.way_points.end(),
                               [](const WayPoint& point) { return point.speed_m_s.has_value(); });
  for (std::size_t i = 0; i < count && any; ++i) {
    speeds[i] = path.way_points[i].speed_m_s ? path.way_points[i].speed_m_s
                : i > 0                      ? speeds[i - 1]
                                             : std::optional<double>(kMostSpeed_m_s);
  }
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t segment = i + 1 < count ? count - 2 - i : count - 1;  // from this point on, the other way round
    const bool has_segment = path.closed || i + 1 < count;
    back.way_points.push_back(
        {path.way_points[count - 1 - i].p_world_m, has_segment ? speeds[segment] : std::optional<double>()});
  }
  return back;
}

}  // namespace situation_awareness
