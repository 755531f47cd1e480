// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/scout_nodelet_params.hpp"

#include <stdexcept>

#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/params/shared_file.hpp"

namespace situation_awareness {

ScoutNodeletParams read_scout_nodelet_params(const ParamReader& reader) {
  auto params = read_nodelet_params<ScoutNodeletParams>(reader);
  forget_keys_of_other_stages(reader, params.unknown);
  params.base_frame = tf2_frame(params.base_frame);
  if (params.base_frame.empty()) throw std::invalid_argument(reader.source() + ": base_frame is empty");
  return params;
}

}  // namespace situation_awareness
