// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/localization_nodelet_params.hpp"

#include <stdexcept>

#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/params/shared_file.hpp"

namespace situation_awareness {

LocalizationNodeletParams read_localization_nodelet_params(const ParamReader& reader) {
  auto params = read_nodelet_params<LocalizationNodeletParams>(reader);
  forget_keys_of_other_stages(reader, params.unknown);
  if (params.reflector_file.empty()) {
    throw std::invalid_argument(reader.source() + ": reflector_file is empty, it must be a file of reflectors");
  }
  params.odom_frame = tf2_frame(params.odom_frame);
  params.base_frame = tf2_frame(params.base_frame);
  if (params.odom_frame == params.nodelet.world_frame) {
    throw std::invalid_argument(reader.source() + ": world_frame and odom_frame are both " + params.odom_frame);
  }
  return params;
}

}  // namespace situation_awareness
