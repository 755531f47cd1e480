// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "situation_awareness/pipeline/splinegon_pipeline.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"

namespace situation_awareness {

/// Parameters of the nodelet splinegon_mapping (cfg/splinegons.yaml, which serves gps_ins, too): the filter of
/// its own is as that is told to be.
struct SplinegonNodeletParams {
  NodeletParams nodelet;
  std::string localization = "gps";
  std::string base_frame = "base_link";
  std::string imu_frame;
  std::string fix_frame;
  std::string origin;
  double fix_sigma_m = 2.0;
  double pose_sigma_m = 0.01;
  double pose_sigma_rad = 0.002;
  double reset_time_jump_s = 1.0;
  SplinegonPipelineParams pipeline;
  GpsInsParams gps_ins;
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    visit("localization", self.localization,
          "where poses come from: gps: the topics `imu` and `fix`, by GPS and INS, whose error may wander; tf: the "
          "transform from world to scanner, whose error is small");
    visit("base_frame", self.base_frame, "frame of the vehicle, whose pose is that by GPS and INS");
    visit("imu_frame", self.imu_frame, "as that of gps_ins");
    visit("fix_frame", self.fix_frame, "as that of gps_ins");
    visit("origin", self.origin,
          "as that of gps_ins; where both run give it to both, since their first good fixes may differ");
    visit("fix_sigma_m", self.fix_sigma_m, Bounds{0.001, 1000.0}, "m", "as that of gps_ins");
    visit("pose_sigma_m", self.pose_sigma_m, Bounds{0.0, 100.0}, "m",
          "standard deviation of x and of y of the pose of a scan by TF");
    visit("pose_sigma_rad", self.pose_sigma_rad, Bounds{0.0, 3.0}, "rad", "the same of its yaw");
    visit("reset_time_jump_s", self.reset_time_jump_s, Bounds{0.0, 1e6}, "s",
          "a stamp that goes back by more than this begins a new map");
    SplinegonPipelineParams::fields(self.pipeline, visit);
    visit("gps_ins", self.gps_ins);
  }
};

/// As read_nodelet_params; keys of other stages, which may read the same file, are not unknown.
SplinegonNodeletParams read_splinegon_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness
