// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "situation_awareness/path/path_following.hpp"
#include "situation_awareness/path/safety_areas.hpp"
#include "situation_awareness/path/vehicle.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"
#include "situation_awareness/scan/range_limiter.hpp"

namespace situation_awareness {

/// Parameters of the nodelets safety_areas and path_following (cfg/map.yaml, which serves all stages on the way to the
/// one map, too).
struct PathNodeletParams {
  NodeletParams nodelet;
  std::string path_file;
  std::string base_frame = "base_link";
  bool start_at_once = false;
  /// Set by path_following when it starts at once, so that it does not drive on by itself after a crash.
  bool has_driven = false;
  std::string local_maps_file;
  double pose_sigma_m = 0.02;
  double pose_sigma_rad = 0.01;
  RangeLimiterParams scan;
  VehicleParams vehicle;
  SafetyParams safety;
  PathFollowingParams path;
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    visit("path_file", self.path_file, "YAML file of the way points of the path, in the world");
    visit("base_frame", self.base_frame, kBaseFrameDoc);
    visit("start_at_once", self.start_at_once,
          "drive as soon as pose and verdict are there; else when the service path_following/start is called");
    visit("has_driven", self.has_driven, "");
    visit("local_maps_file", self.local_maps_file,
          "YAML file of the chains beside each segment of the path, by which safety_areas starts until a map comes, "
          "and which its service save_local_maps writes; empty: none");
    visit("pose_sigma_m", self.pose_sigma_m, Bounds{0.0, 100.0}, "m",
          "standard deviation of x and of y of a scan's pose that comes without a covariance on `pose`");
    visit("pose_sigma_rad", self.pose_sigma_rad, Bounds{0.0, 3.0}, "rad", "the same of its yaw");
    visit("scan", self.scan);
    visit("vehicle", self.vehicle);
    visit("safety", self.safety);
    visit("path", self.path);
  }
};

/// As read_nodelet_params; keys of other stages, which read the same file, are not unknown.
PathNodeletParams read_path_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness
