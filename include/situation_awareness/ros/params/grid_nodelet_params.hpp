// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "situation_awareness/pipeline/grid_pipeline.hpp"
#include "situation_awareness/ros/params/elevation_params.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"

namespace situation_awareness {

/// Parameters of the nodelet grid_mapping (cfg/grid.yaml).
struct GridNodeletParams {
  NodeletParams nodelet;
  ElevationParams elevation;
  std::string image_kind = "auto";
  double grid_period_s = 1.0;
  GridPipelineParams pipeline;
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    ElevationParams::fields(self.elevation, visit);
    visit("image_kind", self.image_kind,
          "what the images are: rectified, with P of camera_info, or raw, with K and D; auto: what the topic's name "
          "says (image_rect*, image_raw), else rectified where there is distortion");
    visit("grid_period_s", self.grid_period_s, Bounds{0.0, 1e6}, "s", "least time between grids, by their stamps");
    GridPipelineParams::fields(self.pipeline, visit);
  }
};

/// As read_nodelet_params; keys of other stages, which may read the same file, are not unknown.
GridNodeletParams read_grid_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness
