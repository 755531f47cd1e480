// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/ros/params/param_reader.hpp"

namespace situation_awareness {

/// Parameters of a nodelet: those of the ROS boundary, and those of the stages (cfg/objects.yaml). All three nodelets
/// take the same ones, so that one file and one line of a launch file serve them all.
struct NodeletParams {
  std::string world_frame = "world";
  double tf_timeout_s = 0.5;
  bool deskew = true;
  int queue_size = 20;
  double downlink_rate_hz = 5.0;
  std::string model_folder;  ///< where models are looked for; empty: models/ of this package
  ObjectPipelineParams pipeline;
  std::vector<UnknownKey> unknown;  ///< keys that none of these has

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("world_frame", self.world_frame, "fixed frame of the map, which TF must connect with the frame of the scans");
    visit("tf_timeout_s", self.tf_timeout_s, Bounds{0.0, 60.0}, "s",
          "maximum time that a scan waits for its transform, in wall time");
    visit("deskew", self.deskew,
          "transform each beam at its own time where the scan has a time_increment; a scan then also waits for the "
          "transform at its last beam, up to one period of TF longer");
    visit("queue_size", self.queue_size, Bounds{1, 1000}, "scans",
          "maximum number of scans that wait for their transforms; in a full queue a new scan replaces the newest one");
    visit("downlink_rate_hz", self.downlink_rate_hz, Bounds{0.1, 1000.0}, "Hz",
          "maximum rate of downlink/objects, in wall time");
    visit("model_folder", self.model_folder, "folder of the detector's network; empty: models/ of this package");
    ObjectPipelineParams::fields(self.pipeline, visit);
  }
};

/// Read from the parameter server; a relative model is looked for in ~model_folder. Throws std::invalid_argument with
/// one sentence.
NodeletParams read_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness
