// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/image_labelling_nodelet_params.hpp"

#include "situation_awareness/ros/params/package.hpp"
#include "situation_awareness/ros/params/shared_file.hpp"

namespace situation_awareness {

ImageLabellingNodeletParams read_image_labelling_nodelet_params(const ParamReader& reader) {
  auto params = read_nodelet_params<ImageLabellingNodeletParams>(reader);
  forget_keys_of_other_stages(reader, params.unknown);
  if (params.model_folder.empty()) params.model_folder = package_folder() + "/models";
  return params;
}

}  // namespace situation_awareness
