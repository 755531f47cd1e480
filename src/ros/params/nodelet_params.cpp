// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/nodelet_params.hpp"

#include <stdexcept>

#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/params/package.hpp"

namespace situation_awareness {

NodeletParams read_nodelet_params(const ParamReader& reader) {
  std::vector<UnknownKey> unknown;
  auto params = reader.read<NodeletParams>([&unknown](const UnknownKey& key) {
    if (key.path != "live") unknown.push_back(key);  // that is the namespace of LiveParams
  });
  params.unknown = unknown;
  params.world_frame = tf2_frame(params.world_frame);
  if (params.world_frame.empty()) throw std::invalid_argument(reader.source() + ": world_frame is empty");
  if (params.model_folder.empty()) params.model_folder = package_folder() + "/models";
  params.pipeline.detections.model_folder = params.model_folder;
  return params;
}

}  // namespace situation_awareness
