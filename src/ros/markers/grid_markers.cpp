// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/markers/grid_markers.hpp"

#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>

#include "make_marker.hpp"

namespace situation_awareness {
namespace {

using visualization_msgs::Marker;

constexpr Color kTargetColor{0.85F, 0.1F, 0.1F};
constexpr Color kRegionColor{1.0F, 0.6F, 0.2F};
constexpr double kPostHeight_m = 4.0;
constexpr double kAboveGround_m = 0.3;
constexpr double kRadius99 = 3.0349;  ///< sqrt of the 99 % quantile of chi-square with two degrees of freedom

Marker post_of(const std_msgs::Header& header, const GridTarget& target) {
  Marker m = make_marker(header, "target", target.id, Marker::CYLINDER, kTargetColor, 1.0F);
  m.pose.position = make_point(target.p_world_m.head<2>(), target.p_world_m.z() + 0.5 * kPostHeight_m);
  m.scale.x = m.scale.y = 0.3;
  m.scale.z = kPostHeight_m;
  return m;
}

Marker region_of(const std_msgs::Header& header, const GridTarget& target) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(target.covariance_m2);
  const Eigen::Vector2d sigma_m = eigen.eigenvalues().cwiseMax(1e-6).cwiseSqrt();
  const double yaw_rad = std::atan2(eigen.eigenvectors()(1, 0), eigen.eigenvectors()(0, 0));
  Marker m = make_marker(header, "region", target.id, Marker::CYLINDER, kRegionColor, 0.6F);
  m.pose.position = make_point(target.p_world_m.head<2>(), target.p_world_m.z() + kAboveGround_m);
  m.pose.orientation.z = std::sin(0.5 * yaw_rad);
  m.pose.orientation.w = std::cos(0.5 * yaw_rad);
  m.scale.x = 2.0 * kRadius99 * sigma_m.x();
  m.scale.y = 2.0 * kRadius99 * sigma_m.y();
  m.scale.z = 0.05;
  return m;
}

Marker label_of(const std_msgs::Header& header, const GridTarget& target) {
  Marker m = make_marker(header, "label", target.id, Marker::TEXT_VIEW_FACING, kInkColor, 1.0F);
  m.pose.position = make_point(target.p_world_m.head<2>(), target.p_world_m.z() + kPostHeight_m + 1.0);
  m.scale.z = 2.0;
  char text[60];
  std::snprintf(text, sizeof text, "%llu  %.0f %%", static_cast<unsigned long long>(target.id),
                100.0 * target.probability);
  m.text = text;
  return m;
}

}  // namespace

std::vector<visualization_msgs::Marker> markers_of(const GridTargets& targets, const std::string& world_frame) {
  const std_msgs::Header header = make_header(world_frame, targets.stamp_ns);
  std::vector<Marker> markers;
  for (const GridTarget& target : targets.targets) {
    markers.push_back(post_of(header, target));
    markers.push_back(region_of(header, target));
    markers.push_back(label_of(header, target));
  }
  return markers;
}

}  // namespace situation_awareness
