// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/ros/params/param_reader.hpp"

namespace situation_awareness {

/// Parameters of a nodelet: those of the ROS boundary, and those of the stages (cfg/objects.yaml). All three nodelets
/// take the same ones, so that one file and one line of a launch file serve them all.
struct NodeletParams {
  std::string world_frame = "world";  ///< frame of the map, the root of TF
  double tf_timeout_s = 0.5;          ///< how long a scan waits for world -> lidar at its stamp, in wall time
  bool deskew = true;                 ///< take each beam at its own time, where a scan says time_increment
  int queue_size = 20;                ///< how many scans may wait
  ObjectPipelineParams pipeline;
};

/// Read from what `reader` has; a relative model is looked for in ~model_folder (default: models/ of this package).
/// Throws std::invalid_argument with one sentence.
NodeletParams read_nodelet_params(ParamReader reader);

}  // namespace situation_awareness
