// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "situation_awareness/pipeline/polygon_pipeline.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"

namespace situation_awareness {

/// Parameters of the nodelet reflector_localization: those of cfg/polygons.yaml, of which it uses the sections
/// `reflectors` and `localization`, and its own.
struct LocalizationNodeletParams {
  NodeletParams nodelet;
  std::string reflector_file;
  std::string initial_pose;
  double initial_sigma_m = 0.12;
  double initial_sigma_rad = 0.07;
  std::string odom_frame;
  std::string base_frame;
  double tf_ahead_s = 0.0;
  PolygonPipelineParams pipeline;
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    visit("reflector_file", self.reflector_file, "YAML file of the reflectors, by which the robot localises itself");
    visit("initial_pose", self.initial_pose,
          "of the base in the world at the start, \"X,Y,YAW\" in m and rad; empty: it is found by three reflectors or "
          "more");
    visit("initial_sigma_m", self.initial_sigma_m, Bounds{1e-3, 100.0}, "m",
          "standard deviation of x and of y of an initial pose that comes without");
    visit("initial_sigma_rad", self.initial_sigma_rad, Bounds{1e-3, 3.0}, "rad",
          "standard deviation of the yaw of an initial pose that comes without");
    visit("odom_frame", self.odom_frame, "frame of the odometry; empty: that of its messages");
    visit("base_frame", self.base_frame, "frame whose pose odometry gives; empty: the child frame of its messages");
    visit("tf_ahead_s", self.tf_ahead_s, Bounds{0.0, 10.0}, "s",
          "the transform from world to odom is published for the time of the scan, and again for this time after it, "
          "for those who look up later times; until then they get that of an older scan");
    PolygonPipelineParams::fields(self.pipeline, visit);
  }
};

/// As read_nodelet_params; keys of other stages, which read the same file, are not unknown.
LocalizationNodeletParams read_localization_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness
