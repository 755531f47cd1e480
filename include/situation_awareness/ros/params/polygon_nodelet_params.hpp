// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "situation_awareness/pipeline/polygon_pipeline.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"

namespace situation_awareness {

/// Parameters of the nodelet polygon_mapping (cfg/polygons.yaml, which serves all stages on the way to the map of
/// polygons).
struct PolygonNodeletParams {
  NodeletParams nodelet;
  double pose_sigma_m = 0.02;
  double pose_sigma_rad = 0.01;
  double pose_timeout_s = 0.2;
  double reset_time_jump_s = 1.0;
  PolygonPipelineParams pipeline;
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    visit("pose_sigma_m", self.pose_sigma_m, Bounds{0.0, 100.0}, "m",
          "standard deviation of x and of y of a scan's pose that comes without a covariance on `pose`");
    visit("pose_sigma_rad", self.pose_sigma_rad, Bounds{0.0, 3.0}, "rad", "the same of its yaw");
    visit("pose_timeout_s", self.pose_timeout_s, Bounds{0.0, 60.0}, "s",
          "maximum time for which segments wait for the covariance of their pose and for the map of objects, in wall "
          "time, where `pose` or `objects` has a publisher");
    visit("reset_time_jump_s", self.reset_time_jump_s, Bounds{0.0, 1e6}, "s",
          "a stamp that goes back by more than this begins a new map");
    PolygonPipelineParams::fields(self.pipeline, visit);
  }
};

/// As read_nodelet_params; keys of other stages, which read the same file, are not unknown.
PolygonNodeletParams read_polygon_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness
