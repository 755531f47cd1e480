// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "situation_awareness/path/circumnavigation.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"
#include "situation_awareness/scan/range_limiter.hpp"

namespace situation_awareness {

/// Parameters of the nodelet circumnavigate.
struct CircumnavigateNodeletParams {
  NodeletParams nodelet;
  std::string base_frame = "base_link";
  SearchPlaces search;
  double timeout_s = 1.0;
  double lost_turn_rate_rad_s = 0.45;
  /// Set by the stage itself: where and when its mission began, for the manager that is started after a crash.
  std::string resume;
  RangeLimiterParams scan;  ///< how the driver fills its messages; beams are seen to their own range_max
  CircumnavigationParams mission;
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    visit("base_frame", self.base_frame, kBaseFrameDoc);
    visit(
        "search", self.search,
        "places [x, y] or [x, y, yaw] in the world, in m and rad, that the vehicle goes to in order to find obstacles");
    visit("timeout_s", self.timeout_s, Bounds{0.05, 100.0}, "s",
          "of wall time: where simulated time stands still so long, odometry is missing, too");
    visit("lost_turn_rate_rad_s", self.lost_turn_rate_rad_s, Bounds{-10.0, 10.0}, "rad/s",
          "commanded before the first odometry: on a circle the vehicle stays where it is, and gps_ins finds its yaw; "
          "not 0");
    visit("resume", self.resume, "");
    visit("scan", self.scan);
    visit("mission", self.mission);
  }
};

/// As read_nodelet_params; keys of other stages, which may read the same file, are not unknown.
CircumnavigateNodeletParams read_circumnavigate_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness
