// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/image/image.hpp"
#include "situation_awareness/map/grid/elevation.hpp"
#include "situation_awareness/map/grid/elevation_file.hpp"
#include "situation_awareness/map/grid/grid.hpp"
#include "situation_awareness/map/grid/grid_map.hpp"
#include "situation_awareness/map/grid/grid_tracks.hpp"
#include "situation_awareness/pipeline/ground_in_view.hpp"
#include "situation_awareness/pipeline/image_labelling.hpp"

namespace situation_awareness {

/// How well the camera's pose is known where nothing says so, and how well it must be.
struct CameraPoseParams {
  double position_sigma_m = 0.3;
  double attitude_sigma_rad = 0.01;
  double max_position_sigma_m = 10.0;
  double max_attitude_sigma_rad = 0.2;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("position_sigma_m", self.position_sigma_m, Bounds{0.0, 100.0}, "m", "standard deviation along each axis");
    visit("attitude_sigma_rad", self.attitude_sigma_rad, Bounds{0.0, 1.0}, "rad", "standard deviation about each axis");
    visit("max_position_sigma_m", self.max_position_sigma_m, Bounds{0.0, 1e4}, "m",
          "an image from a place that is less certain than this along any axis is not used");
    visit("max_attitude_sigma_rad", self.max_attitude_sigma_rad, Bounds{0.0, 3.0}, "rad",
          "the same of the attitude about any axis");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "pose"); }
};

/// All parameters of the pipeline from label images to a semantic grid; cfg/grid.yaml mirrors it.
struct GridPipelineParams {
  CameraPoseParams pose;
  GridMapParams grid;
  GridTracksParams targets;
  ImageLabellingParams labelling;  ///< of who makes the labels
  double keep_m = 0.0;
  double evidence_m = 300.0;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("keep_m", self.keep_m, Bounds{0.0, 1e5}, "m",
          "cells farther from the camera along x or y are forgotten: a grid that scrolls; 0: none are");
    visit("evidence_m", self.evidence_m, Bounds{0.0, 1e5}, "m",
          "cells farther from the camera along x or y, and out of its reach, stay as they are on the grid without the "
          "evidence behind, and so do their targets, until images show them again; 0: all keep it");
    visit("pose", self.pose);
    visit("grid", self.grid);
    visit("targets", self.targets);
    visit("labelling", self.labelling);
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const { check_bounds(*this, "grid pipeline"); }
};

/// From label images with poses to a semantic grid and its targets, in one thread, without ROS.
class GridPipeline {
 public:
  /// Throws std::invalid_argument naming field and bound.
  GridPipeline(const GridPipelineParams& params, std::shared_ptr<const Elevation> elevation);

  /// Over the heights of a file that are around the camera. Throws as that one, and as ElevationFile.
  GridPipeline(const GridPipelineParams& params, ElevationFile file);

  /// As StampOrder::trust, where another has judged the stamps.
  void trust_stamps() { order_.trust(); }

  /// Adds an image; all as GridMap::update says. `covariance`: of the camera's pose, where it is known; throws
  /// std::invalid_argument if it is none (is_positive_semidefinite); and std::runtime_error if the elevation's file
  /// cannot be read. An image whose stamp is not in order, or whose pose is not known well enough (CameraPoseParams),
  /// changes nothing. The result is valid until the next call.
  const GridTargets& process(const SoftLabels& labels, const Eigen::Isometry3d& T_world_camera,
                             const std::optional<CameraPoseCovariance>& covariance = {});

  /// Whether the pose of the latest image was known well enough.
  bool is_pose_known() const { return is_pose_known_; }

  /// Of the latest image: kRefused, or kRestart where it is the first of a new map.
  StampOrder::Verdict verdict() const { return verdict_; }

  /// A new map. The ids of its targets were not used before.
  void begin_anew();

  const GridTargets& targets() const { return tracks_.targets(); }
  /// Why the latest image that was used tells nothing of the map: no cell of known ground is in it, or no label known.
  /// A short reason, for counters; empty if it does.
  std::string why_latest_tells_nothing() const { return in_view_.why_not_latest(); }
  /// What was assumed of the elevation's file, each in one sentence.
  std::vector<std::string> elevation_warnings() const;
  /// Why the images so far give no target, or hardly ever one, in one sentence: none shows the ground, or they show the
  /// class where the elevation says that no ground is, so that targets are none or wrong. Empty if they do, and where
  /// they show nothing of the class.
  std::string why_nothing() const;
  const GridMap& map() const { return map_; }

 private:
  void look_around(const Eigen::Vector2d& p_world_m);

  GridPipelineParams params_;
  StampOrder order_;
  StampOrder::Verdict verdict_ = StampOrder::Verdict::kNext;
  bool is_pose_known_ = true;
  std::optional<ElevationFile> file_;
  std::shared_ptr<const Elevation> elevation_;
  GridMap map_;
  GridTracks tracks_;
  GroundInView in_view_;
  std::size_t target_images_ = 0;  ///< after which there was a target
  SemanticGrid class_grid_;
  std::vector<GridCluster> clusters_;
};

}  // namespace situation_awareness
