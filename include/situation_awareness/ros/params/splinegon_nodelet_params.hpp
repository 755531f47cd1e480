// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "situation_awareness/pipeline/splinegon_pipeline.hpp"
#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"

namespace situation_awareness {

/// Parameters of the nodelet splinegon_mapping (cfg/splinegons.yaml, which serves gps_ins, too): the filter of
/// its own is as that is told to be.
struct SplinegonNodeletParams {
  NodeletParams nodelet;
  std::string localization = "gps";
  InertialParams inertial;
  double pose_sigma_m = 0.01;
  double pose_sigma_rad = 0.002;
  double reset_time_jump_s = 1.0;
  SplinegonPipelineParams pipeline;
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    visit("localization", self.localization,
          "where poses come from: gps: the topics `imu` and `fix`, by GPS and INS, whose error may wander; tf: the "
          "transform from world to scanner, whose error is small");
    InertialParams::fields(self.inertial, visit);
    visit("pose_sigma_m", self.pose_sigma_m, Bounds{0.0, 100.0}, "m",
          "standard deviation of x and of y of the pose of a scan by TF");
    visit("pose_sigma_rad", self.pose_sigma_rad, Bounds{0.0, 3.0}, "rad", "the same of its yaw");
    visit("reset_time_jump_s", self.reset_time_jump_s, Bounds{0.0, 1e6}, "s",
          "a stamp that goes back by more than this begins a new map");
    SplinegonPipelineParams::fields(self.pipeline, visit);
  }
};

/// As read_nodelet_params; keys of other stages, which may read the same file, are not unknown.
SplinegonNodeletParams read_splinegon_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness
