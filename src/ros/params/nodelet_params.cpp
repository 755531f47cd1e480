// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/nodelet_params.hpp"

#include <stdexcept>

#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/params/package.hpp"

namespace situation_awareness {

NodeletParams read_nodelet_params(ParamReader reader) {
  NodeletParams params;
  params.world_frame = tf2_frame(reader.take_text("world_frame", params.world_frame));
  if (params.world_frame.empty()) throw std::invalid_argument(reader.source() + ": world_frame is empty");
  params.tf_timeout_s = reader.take_number("tf_timeout_s", params.tf_timeout_s, Bounds{0.0, 60.0}, "s");
  params.deskew = reader.take_flag("deskew", params.deskew);
  params.queue_size = reader.take_integer("queue_size", params.queue_size, Bounds{1, 1000}, "scans");
  reader.skip("live");  // LiveParams'
  std::string model_folder = reader.take_text("model_folder", "");
  if (model_folder.empty()) model_folder = package_folder() + "/models";
  params.pipeline = parse_object_pipeline_params(reader.rest_as_yaml(), reader.source(), model_folder);
  return params;
}

}  // namespace situation_awareness
