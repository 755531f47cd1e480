// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/image/image.hpp"
#include "situation_awareness/map/grid/elevation.hpp"
#include "situation_awareness/map/grid/grid.hpp"

namespace situation_awareness {

/// A box that stands upright on the ground, with the ground's height at its middle.
struct SceneCar {
  Pose2 T_world_car;
  Eigen::Vector3d size_m{4.4, 1.8, 1.5};  ///< length, width, height
};

/// A ball on a thin trunk, which hides what is behind it and is no ground.
struct SceneTree {
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  double radius_m = 2.5;
  double middle_m = 4.0;  ///< above the ground
};

/// An upright box over the ground at its middle: a house, or a part of one.
struct SceneBox {
  Pose2 T_world_box;
  Eigen::Vector3d size_m;
  double bottom_m = 0.0;  ///< above the ground
};

/// A scene whose label images are computed by casting rays, so that what each pixel shows is known.
struct GridScene {
  std::function<double(double x_world_m, double y_world_m)> ground;  ///< height
  double steepest = 0.0;                                             ///< slope of the ground
  std::vector<SceneCar> cars;
  std::vector<SceneTree> trees;
  std::vector<SceneBox> houses;  ///< hide what is behind them
  std::vector<SceneBox> signs;   ///< that labels take for cars
};

/// The share of each pixel that is car, by `samples` x `samples` rays per pixel.
SoftLabels label_image_of(const GridScene& scene, const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera,
                          int samples);

/// The camera's pose where it looks along a yaw and pitch (positive up).
Eigen::Isometry3d camera_pose(const Eigen::Vector3d& p_world_m, double yaw_rad, double pitch_rad);

/// A scene, what the map is given of it, and the flight over it.
struct GridCase {
  std::string name;
  GridScene scene;
  double elevation_error_m = 0.0;                        ///< of the elevation that the map gets: common
  double elevation_noise_m = 0.0;                        ///< of each pixel
  double label_precision = 1.0, label_recall = 1.0;      ///< of pixels
  int blobs = 0;                                         ///< false ones per image
  double sign_share = 0.9;                               ///< of the images that take a sign for a car
  double position_noise_m = 0.0, angle_noise_rad = 0.0;  ///< white, each axis
  double wander_m = 0.0, wander_s = 40.0;                ///< of the position, each axis, and after which 1/e is left
  std::vector<Eigen::Isometry3d> T_world_camera;
  std::size_t hidden_cars = 0;  ///< of the scene, the last ones: never seen
};

/// The kinds of cases of docs/benchmarks/grid.md. The same seed gives the same case.
std::vector<std::string> grid_case_names();
GridCase make_grid_case(const std::string& name, std::uint32_t seed);

/// The elevation that the map gets, of pixels of `pixel_m`.
Elevation elevation_of(const GridCase& given, double pixel_m, std::uint32_t seed);

/// Labels of image `i` with the errors of the case.
SoftLabels labels_of(const GridCase& given, const PinholeCamera& camera, std::size_t i, std::uint32_t seed);

/// The pose of image `i` that the map gets.
Eigen::Isometry3d given_pose(const GridCase& given, std::size_t i, std::uint32_t seed);

/// Its covariance, if the case tells the map: that of a pose by GPS and INS, which wanders.
std::optional<CameraPoseCovariance> given_covariance(const GridCase& given);

/// Of cells by their middles.
struct GridScore {
  double intersection_over_union = 0.0;
  double shadow_share = 0.0;  ///< of cells up to 8 m behind a car, as seen from the last camera, called car
};
GridScore score(const GridCase& given, const SemanticGrid& grid);

/// For each car the index of its target, or -1: one-to-one, as many pairs within 3 m as there can be, and of these
/// those with the least sum of distances.
std::vector<int> targets_of(const std::vector<SceneCar>& cars, const GridTargets& targets);

/// Of targets against the cars that can be seen.
struct TargetScore {
  int cars = 0;
  int missed = 0;               ///< cars without a target
  int wrong = 0;                ///< targets without a car
  int inside = 0;               ///< cars within the 99 % regions of their targets; one without a target is not
  double distance_sum_m = 0.0;  ///< of the centroids of the cars that have a target
};
TargetScore score(const GridCase& given, const GridTargets& targets);

}  // namespace situation_awareness
