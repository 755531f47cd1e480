// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "situation_awareness/pipeline/map_pipeline.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"

namespace situation_awareness {

/// Parameters of the nodelets semantic_map and inertial_semantic_map (cfg/map.yaml, which serves all stages on the way
/// to the one map).
struct MapNodeletParams {
  NodeletParams nodelet;
  std::string kinds = "objects,polygons,splinegons";
  double pose_sigma_m = 0.02;
  double pose_sigma_rad = 0.01;
  double pose_timeout_s = 0.2;
  double max_pose_age_s = 0.5;
  double reset_time_jump_s = 1.0;
  std::string base_frame = "base_link";
  std::string imu_frame;
  std::string fix_frame;
  std::string origin;
  double fix_sigma_m = 2.0;
  MapPipelineParams pipeline;
  GpsInsParams gps_ins;
  ObjectPipelineParams objects;  ///< of inertial_semantic_map alone
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    visit(
        "kinds", self.kinds,
        "what is on the map, separated by commas: objects, polygons, splinegons (boundaries of large obstacles), grid "
        "(targets of images)");
    visit("pose_sigma_m", self.pose_sigma_m, Bounds{0.0, 100.0}, "m",
          "standard deviation of x and of y of a scan's pose that comes without a covariance on `pose`");
    visit("pose_sigma_rad", self.pose_sigma_rad, Bounds{0.0, 3.0}, "rad", "the same of its yaw");
    visit("pose_timeout_s", self.pose_timeout_s, Bounds{0.0, 60.0}, "s",
          "maximum time for which segments wait for the covariance of their pose and for the map of objects, in wall "
          "time, where `pose` or `objects` has a publisher");
    visit("max_pose_age_s", self.max_pose_age_s, Bounds{0.05, 10.0}, "s",
          "how far from the stamp of a scan that of the message on `pose` may be whose covariance is its own");
    visit("reset_time_jump_s", self.reset_time_jump_s, Bounds{0.0, 1e6}, "s",
          "a stamp that goes back by more than this begins a new map");
    visit("base_frame", self.base_frame, "frame of the vehicle, whose pose is that by GPS and INS");
    visit("imu_frame", self.imu_frame, "as that of gps_ins");
    visit("fix_frame", self.fix_frame, "as that of gps_ins");
    visit("origin", self.origin,
          "as that of gps_ins; where both run give it to both, since their first good fixes may differ");
    visit("fix_sigma_m", self.fix_sigma_m, Bounds{0.001, 1000.0}, "m", "as that of gps_ins");
    MapPipelineParams::fields(self.pipeline, visit);
    visit("gps_ins", self.gps_ins);
  }
};

/// As read_nodelet_params; keys of other stages, which read the same file, are not unknown. Throws
/// std::invalid_argument if a kind is unknown, too.
MapNodeletParams read_map_nodelet_params(const ParamReader& reader);

/// The same with those of the objects that the nodelet follows itself, and of GPS and INS.
MapNodeletParams read_inertial_map_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness
