// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/grid.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include <sensor_msgs/point_cloud2_iterator.h>

#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

constexpr double kMostCells = 1e6;   ///< of a grid that came, from the world's origin and along an edge
constexpr double kOnLattice = 0.01;  ///< of a cell
constexpr double kLevel = 1e-6;      ///< of a quaternion

}  // namespace

TargetArray grid_targets_to_msg(const GridTargets& targets, const std::string& world_frame) {
  TargetArray msg;
  msg.header.stamp = to_ros_time(targets.stamp_ns);
  msg.header.frame_id = world_frame;
  msg.targets.reserve(targets.targets.size());
  for (const GridTarget& target : targets.targets) {
    MappedTarget& out = msg.targets.emplace_back();
    out.id = target.id;
    out.position.x = target.p_world_m.x();
    out.position.y = target.p_world_m.y();
    out.position.z = target.p_world_m.z();
    for (int i = 0; i < 4; ++i) out.covariance[static_cast<std::size_t>(i)] = target.covariance_m2(i / 2, i % 2);
    out.area = target.area_m2;
    out.probability = target.probability;
  }
  return msg;
}

GridTargets grid_targets_from_msg(const TargetArray& msg) {
  GridTargets targets;
  targets.stamp_ns = to_nanoseconds(msg.header.stamp);
  targets.targets.reserve(msg.targets.size());
  for (const auto& in : msg.targets) {
    GridTarget& target = targets.targets.emplace_back();
    target.id = in.id;
    target.p_world_m = {in.position.x, in.position.y, in.position.z};
    target.covariance_m2 << in.covariance[0], in.covariance[1], in.covariance[2], in.covariance[3];
    target.area_m2 = in.area;
    target.probability = in.probability;
    if (target.id == 0) throw std::invalid_argument("a target has no id");
    const bool is_finite = target.p_world_m.allFinite() && target.covariance_m2.allFinite() &&
                           std::isfinite(target.area_m2) && std::isfinite(target.probability);
    if (!is_finite || target.covariance_m2.diagonal().minCoeff() < 0.0) {
      throw std::invalid_argument("a target has a number that is not finite, or a negative variance");
    }
  }
  return targets;
}

nav_msgs::OccupancyGrid grid_to_msg(const SemanticGrid& grid, const std::string& world_frame) {
  nav_msgs::OccupancyGrid msg;
  msg.header.stamp = msg.info.map_load_time = to_ros_time(grid.stamp_ns);
  msg.header.frame_id = world_frame;
  msg.info.resolution = static_cast<float>(grid.cell_m);
  msg.info.width = static_cast<std::uint32_t>(grid.width);
  msg.info.height = static_cast<std::uint32_t>(grid.height);
  msg.info.origin.position.x = grid.first_column * grid.cell_m;
  msg.info.origin.position.y = grid.first_row * grid.cell_m;
  msg.info.origin.orientation.w = 1.0;
  msg.data.reserve(grid.probability.size());
  for (const float probability : grid.probability) {
    msg.data.push_back(std::isnan(probability) ? std::int8_t{-1}
                                               : static_cast<std::int8_t>(std::lround(100.0F * probability)));
  }
  return msg;
}

SemanticGrid grid_from_msg(const nav_msgs::OccupancyGrid& msg) {
  SemanticGrid grid;
  grid.stamp_ns = to_nanoseconds(msg.header.stamp);
  grid.cell_m = static_cast<double>(msg.info.resolution);
  const auto& origin = msg.info.origin;
  if (!(grid.cell_m > 0.0) || !std::isfinite(grid.cell_m)) throw std::invalid_argument("a grid without a resolution");
  const double column = origin.position.x / grid.cell_m, row = origin.position.y / grid.cell_m;
  if (!(std::abs(column) < kMostCells && std::abs(row) < kMostCells) || std::abs(origin.orientation.x) > kLevel ||
      std::abs(origin.orientation.y) > kLevel || std::abs(origin.orientation.z) > kLevel ||
      std::abs(column - std::round(column)) > kOnLattice || std::abs(row - std::round(row)) > kOnLattice) {
    throw std::invalid_argument("a grid whose cells are not along the axes, on multiples of their size");
  }
  if (msg.info.width > kMostCells || msg.info.height > kMostCells ||
      static_cast<std::size_t>(msg.info.width) * msg.info.height != msg.data.size()) {
    throw std::invalid_argument("a grid with more or fewer cells than its size says");
  }
  grid.first_column = static_cast<int>(std::lround(column));
  grid.first_row = static_cast<int>(std::lround(row));
  grid.width = static_cast<int>(msg.info.width);
  grid.height = static_cast<int>(msg.info.height);
  grid.probability.reserve(msg.data.size());
  for (const std::int8_t percent : msg.data) {
    if (percent < -1 || percent > 100) throw std::invalid_argument("a grid with a cell that is no percentage");
    grid.probability.push_back(percent < 0 ? std::numeric_limits<float>::quiet_NaN()
                                           : 0.01F * static_cast<float>(percent));
  }
  grid.images.assign(msg.data.size(), 0);
  grid.class_images.assign(msg.data.size(), 0);
  grid.class_latest.assign(msg.data.size(), 0);
  grid.ground_world_m.assign(msg.data.size(), std::numeric_limits<float>::quiet_NaN());
  return grid;
}

sensor_msgs::PointCloud2 grid_to_cloud(const SemanticGrid& grid, const std::string& world_frame) {
  sensor_msgs::PointCloud2 cloud;
  cloud.header.stamp = to_ros_time(grid.stamp_ns);
  cloud.header.frame_id = world_frame;
  sensor_msgs::PointCloud2Modifier modifier(cloud);
  modifier.setPointCloud2FieldsByString(2, "xyz", "rgb");
  const auto is_shown = [](float probability) { return !std::isnan(probability); };
  modifier.resize(static_cast<std::size_t>(std::count_if(grid.probability.begin(), grid.probability.end(), is_shown)));
  sensor_msgs::PointCloud2Iterator<float> p(cloud, "x");
  sensor_msgs::PointCloud2Iterator<std::uint8_t> bgr(cloud, "rgb");
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      const std::size_t i = grid.index(column, row);
      const float probability = grid.probability[i];
      if (!is_shown(probability)) continue;
      const Eigen::Vector2d middle_m = grid.middle_world_m(column, row);
      p[0] = static_cast<float>(middle_m.x());
      p[1] = static_cast<float>(middle_m.y());
      p[2] = grid.ground_world_m[i];
      const auto mix = [&](float none, float full) {
        return static_cast<std::uint8_t>(none + probability * (full - none));
      };
      bgr[0] = mix(150.0F, 20.0F);
      bgr[1] = mix(165.0F, 30.0F);
      bgr[2] = mix(150.0F, 225.0F);
      ++p;
      ++bgr;
    }
  }
  return cloud;
}

}  // namespace situation_awareness
