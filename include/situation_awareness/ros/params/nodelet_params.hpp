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
    visit("world_frame", self.world_frame, "frame of the map; TF must lead from it to the frame of the scans");
    visit("tf_timeout_s", self.tf_timeout_s, Bounds{0.0, 60.0}, "s",
          "how long a scan waits for its transform, in wall time");
    visit("deskew", self.deskew,
          "take each beam at its own time, where a scan says time_increment; a scan then waits for its transform at "
          "the last beam as well, for up to a period of TF longer");
    visit("queue_size", self.queue_size, Bounds{1, 1000}, "scans",
          "how many may wait for their transforms; of more, the newest takes the place of the one before it");
    visit("downlink_rate_hz", self.downlink_rate_hz, Bounds{0.1, 1000.0}, "Hz",
          "how often downlink/objects is sent at most, in wall time");
    visit("model_folder", self.model_folder,
          "where the detector's network is looked for; empty: models/ of this package");
    ObjectPipelineParams::fields(self.pipeline, visit);
  }
};

/// Read from the parameter server; a relative model is looked for in ~model_folder. Throws std::invalid_argument with
/// one sentence.
NodeletParams read_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness
