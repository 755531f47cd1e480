// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "situation_awareness/pipeline/map_pipeline.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"
#include "situation_awareness/ros/params/scan_pose_params.hpp"

namespace situation_awareness {

/// Parameters of the nodelets semantic_map and inertial_semantic_map (cfg/map.yaml, which serves all stages on the way
/// to the one map).
struct MapNodeletParams {
  NodeletParams nodelet;
  std::string kinds = "objects,polygons,splinegons";
  ScanPoseParams scan_pose;
  InertialParams inertial;
  MapPipelineParams pipeline;
  ObjectPipelineParams objects;  ///< of inertial_semantic_map alone
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    visit(
        "kinds", self.kinds,
        "what is on the map, separated by commas: objects, polygons, splinegons (boundaries of large obstacles), grid "
        "(targets of images)");
    ScanPoseParams::fields(self.scan_pose, visit);
    InertialParams::fields(self.inertial, visit);
    MapPipelineParams::fields(self.pipeline, visit);
  }
};

/// As read_nodelet_params; keys of other stages, which read the same file, are not unknown. Throws
/// std::invalid_argument if a kind is unknown, too.
MapNodeletParams read_map_nodelet_params(const ParamReader& reader);

/// Reads what read_map_nodelet_params reads, and the parameters of the objects, which the nodelet tracks itself, and of
/// GPS and INS. Throws as read_map_nodelet_params.
MapNodeletParams read_inertial_map_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness
