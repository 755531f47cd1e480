// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/vehicle.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>

#include <yaml-cpp/yaml.h>

namespace situation_awareness {
namespace {

constexpr std::size_t kMostCorners = 32;
constexpr double kLeastInside_m = 0.01;  // of the base's origin, from each edge
constexpr double kMostReach_m = 20.0;

double turn_m2(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

std::string yaml_text(const Footprint& footprint) {
  std::string list;
  for (const Eigen::Vector2d& corner : footprint.corners_m) {
    list += (list.empty() ? "[" : ", [") + yaml_text(corner.x()) + ", " + yaml_text(corner.y()) + "]";
  }
  return "[" + list + "]";
}

void read_yaml_text(const std::string& yaml, Footprint& footprint) try {
  const YAML::Node list = YAML::Load(yaml);
  if (!list.IsSequence()) throw YAML::Exception(YAML::Mark::null_mark(), "no list");
  Footprint read;
  for (const auto& row : list.as<std::vector<std::array<double, 2>>>()) read.corners_m.emplace_back(row[0], row[1]);
  footprint = read;
} catch (const YAML::Exception&) {
  throw std::invalid_argument("must be a list of [x, y]");
}

double clearance_m(const Footprint& footprint, const Eigen::Vector2d& p_base_m) {
  const auto& corners = footprint.corners_m;
  bool inside = true;
  double nearest_m2 = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0, last = corners.size() - 1; i < corners.size(); last = i++) {
    const Eigen::Vector2d edge = corners[i] - corners[last];
    const Eigen::Vector2d d = p_base_m - corners[last];
    if (turn_m2(edge, d) >= 0.0) continue;
    inside = false;
    const double part = std::clamp(d.dot(edge) / edge.squaredNorm(), 0.0, 1.0);
    nearest_m2 = std::min(nearest_m2, (d - part * edge).squaredNorm());
  }
  return inside ? 0.0 : std::sqrt(nearest_m2);
}

double reach_m(const Footprint& footprint) {
  double reach_m2 = 0.0;
  for (const Eigen::Vector2d& corner : footprint.corners_m) reach_m2 = std::max(reach_m2, corner.squaredNorm());
  return std::sqrt(reach_m2);
}

void VehicleParams::validate() const {
  check_bounds(*this, "vehicle");
  if (slowing_m_s2 > braking_m_s2) {
    throw std::invalid_argument("vehicle.slowing_m_s2 must not be greater than vehicle.braking_m_s2");
  }
  const auto& corners = footprint.corners_m;
  if (corners.size() < 3 || corners.size() > kMostCorners) {
    throw std::invalid_argument("vehicle.footprint must have from 3 to 32 corners, not " +
                                std::to_string(corners.size()));
  }
  for (const Eigen::Vector2d& corner : corners) {
    if (!corner.allFinite() || !(corner.norm() <= kMostReach_m)) {
      throw std::invalid_argument("vehicle.footprint has a corner that is not within 20 m of the base's origin");
    }
  }
  double turned_rad = 0.0;
  for (std::size_t i = 0, last = corners.size() - 1; i < corners.size(); last = i++) {
    const Eigen::Vector2d edge = corners[i] - corners[last];
    const Eigen::Vector2d next = corners[(i + 1) % corners.size()] - corners[i];
    const bool inside = turn_m2(edge, -corners[last]) >= kLeastInside_m * edge.norm();
    if (!(edge.norm() > 1e-6) || !(turn_m2(edge, next) > 0.0) || !inside) {
      throw std::invalid_argument(
          "vehicle.footprint must be convex and counter-clockwise, with the base's origin at least 0.01 m inside");
    }
    turned_rad += std::atan2(turn_m2(edge, next), edge.dot(next));
  }
  if (turned_rad > 7.0) throw std::invalid_argument("vehicle.footprint must go round once");
}

}  // namespace situation_awareness
