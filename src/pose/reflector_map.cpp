// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/reflector_map.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <stdexcept>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "situation_awareness/common/file.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/yaml_defect.hpp"

namespace situation_awareness {
namespace {

constexpr Bounds kCoordinate{-1e6, 1e6};
constexpr double kMaxRadius_m = 1.0;
constexpr std::size_t kMaxReflectors = 10'000;
constexpr std::array<const char*, 3> kKeys = {"x", "y", "radius_m"};

[[noreturn]] void fail(const std::string& source, const std::string& reason) {
  throw std::invalid_argument(source + ": " + reason);
}

std::string named(std::size_t i) { return "reflectors[" + std::to_string(i) + ']'; }

void check_count(std::size_t reflectors, const std::string& source) {
  if (reflectors <= kMaxReflectors) return;
  fail(source,
       "reflectors has " + std::to_string(reflectors) + " entries, more than " + std::to_string(kMaxReflectors));
}

double number_of(const YAML::Node& node, const char* key, std::size_t i, const std::string& source) {
  const YAML::Node value = node[key];
  if (!value.IsDefined()) fail(source, named(i) + '.' + key + " is missing");
  double number = 0.0;
  if (!value.IsScalar() || !YAML::convert<double>::decode(value, number)) {
    fail(source, named(i) + '.' + key + " must be a number in m");
  }
  return number;
}

Reflector reflector_of(const YAML::Node& node, std::size_t i, const std::string& source) {
  if (!node.IsMap()) fail(source, named(i) + " must be a map of x, y and radius_m");
  std::array<int, kKeys.size()> given{};
  for (const auto& item : node) {
    const std::string key = item.first.IsScalar() ? item.first.Scalar() : "";
    const auto known = std::find(kKeys.begin(), kKeys.end(), key);
    if (known == kKeys.end()) fail(source, named(i) + " has the unknown key " + yaml_text(key));
    if (++given[static_cast<std::size_t>(known - kKeys.begin())] > 1) {
      fail(source, named(i) + '.' + key + " is given twice");
    }
  }
  return {{number_of(node, "x", i, source), number_of(node, "y", i, source)}, number_of(node, "radius_m", i, source)};
}

}  // namespace

void check_reflectors(const ReflectorMap& map, const std::string& source) {
  if (map.reflectors.empty()) fail(source, "reflectors must have at least one entry");
  check_count(map.reflectors.size(), source);
  for (std::size_t i = 0; i < map.reflectors.size(); ++i) {
    const Reflector& reflector = map.reflectors[i];
    for (int axis = 0; axis < 2; ++axis) {
      const double value = reflector.center_world_m(axis);
      if (value >= kCoordinate.low && value <= kCoordinate.high) continue;  // false for NaN
      fail(source, named(i) + '.' + kKeys[static_cast<std::size_t>(axis)] + " = " + yaml_text(value) + " is outside " +
                       text_of(kCoordinate, "m"));
    }
    if (!(reflector.radius_m > 0.0 && reflector.radius_m <= kMaxRadius_m)) {
      fail(source, named(i) + ".radius_m = " + yaml_text(reflector.radius_m) + " is outside (0, 1] m");
    }
  }
  // By ascending x: of what is too near along that.
  std::vector<std::size_t> by_x(map.reflectors.size());
  std::iota(by_x.begin(), by_x.end(), std::size_t{0});
  const auto x_m = [&](std::size_t i) { return map.reflectors[i].center_world_m.x(); };
  std::sort(by_x.begin(), by_x.end(), [&](std::size_t a, std::size_t b) { return x_m(a) < x_m(b); });
  for (std::size_t n = 0; n < by_x.size(); ++n) {
    for (std::size_t m = n + 1; m < by_x.size() && x_m(by_x[m]) - x_m(by_x[n]) < 2.0 * kMaxRadius_m; ++m) {
      const auto [k, i] = std::minmax(by_x[n], by_x[m]);
      const double distance_m = (map.reflectors[i].center_world_m - map.reflectors[k].center_world_m).norm();
      const double least_m = map.reflectors[i].radius_m + map.reflectors[k].radius_m;
      if (distance_m >= least_m) continue;
      fail(source, named(k) + " and " + named(i) + " overlap: their centres are " + yaml_text(distance_m) +
                       " m apart, less than the sum of their radii, " + yaml_text(least_m) + " m");
    }
  }
}

ReflectorMap read_reflector_map(const std::string& yaml, const std::string& source) {
  YAML::Node root;
  try {
    root = YAML::Load(yaml);
  } catch (const YAML::Exception& error) {
    fail(source, yaml_defect(error));
  }
  if (!root.IsMap() || !root["reflectors"].IsDefined()) fail(source, "must be a map with the key reflectors");
  if (root.size() != 1) fail(source, "reflectors must be the only key");
  const YAML::Node list = root["reflectors"];
  if (!list.IsSequence()) fail(source, "reflectors must be a list");
  check_count(list.size(), source);
  ReflectorMap map;
  for (const YAML::Node& node : list) map.reflectors.push_back(reflector_of(node, map.reflectors.size(), source));
  check_reflectors(map, source);
  return map;
}

void save_reflector_map(const std::string& path, const ReflectorMap& map) {
  check_reflectors(map, path);
  replace_file(path, kind_with_mark("a file of reflectors", "\nreflectors:"), yaml_text(map));
}

ReflectorMap load_reflector_map(const std::string& path) { return read_reflector_map(read_text_file(path), path); }

std::string yaml_text(const ReflectorMap& map) {
  std::string text = "reflectors:\n";
  for (const Reflector& reflector : map.reflectors) {
    text += "  - {x: " + yaml_text(reflector.center_world_m.x()) + ", y: " + yaml_text(reflector.center_world_m.y()) +
            ", radius_m: " + yaml_text(reflector.radius_m) + "}\n";
  }
  return text;
}

}  // namespace situation_awareness
