// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "situation_awareness/path/scouting.hpp"
#include "situation_awareness/ros/params/elevation_params.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"

namespace situation_awareness {

/// Parameters of the nodelet scout (cfg/scout.yaml).
struct ScoutNodeletParams {
  NodeletParams nodelet;
  std::string base_frame = "base_link";
  ElevationParams elevation;
  double timeout_s = 5.0;
  /// Set by the stage itself: where and when its mission began, for the manager that is started after a crash.
  std::string resume;
  ScoutingParams scouting;
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    visit("base_frame", self.base_frame, kBaseFrameDoc);
    ElevationParams::fields(self.elevation, visit);
    visit("timeout_s", self.timeout_s, Bounds{0.1, 1000.0}, "s",
          "where targets are older the vehicle holds, until the way home is due");
    visit("resume", self.resume, "");
    visit("scouting", self.scouting);
  }
};

/// As read_nodelet_params; keys of other stages, which may read the same file, are not unknown.
ScoutNodeletParams read_scout_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness
