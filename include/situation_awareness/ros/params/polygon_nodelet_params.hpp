// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "situation_awareness/pipeline/polygon_pipeline.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"
#include "situation_awareness/ros/params/scan_pose_params.hpp"

namespace situation_awareness {

/// Parameters of the nodelet polygon_mapping (cfg/polygons.yaml, which serves all stages on the way to the map of
/// polygons).
struct PolygonNodeletParams {
  NodeletParams nodelet;
  ScanPoseParams scan_pose;
  double max_pose_age_s = 0.5;
  double reset_time_jump_s = 1.0;
  PolygonPipelineParams pipeline;
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    ScanPoseParams::fields(self.scan_pose, visit);
    visit("max_pose_age_s", self.max_pose_age_s, Bounds{0.05, 10.0}, "s",
          "how far from the stamp of a scan that of the message on `pose` may be whose covariance is its own");
    visit("reset_time_jump_s", self.reset_time_jump_s, Bounds{0.0, 1e6}, "s",
          "a stamp that goes back by more than this begins a new map");
    PolygonPipelineParams::fields(self.pipeline, visit);
  }
};

/// As read_nodelet_params; keys of other stages, which read the same file, are not unknown.
PolygonNodeletParams read_polygon_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness
