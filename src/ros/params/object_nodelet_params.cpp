// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/object_nodelet_params.hpp"

#include "situation_awareness/ros/params/package.hpp"
#include "situation_awareness/ros/params/shared_file.hpp"

namespace situation_awareness {

ObjectNodeletParams read_object_nodelet_params(const ParamReader& reader) {
  auto params = read_nodelet_params<ObjectNodeletParams>(reader);
  forget_keys_of_other_stages(reader, params.unknown);
  if (params.model_folder.empty()) params.model_folder = package_folder() + "/models";
  params.pipeline.detections.model_folder = params.model_folder;
  return params;
}

}  // namespace situation_awareness
