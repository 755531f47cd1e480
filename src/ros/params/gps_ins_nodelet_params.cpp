// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"

#include <stdexcept>

#include "situation_awareness/pose/local_world.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/params/shared_file.hpp"

namespace situation_awareness {

GpsInsNodeletParams read_gps_ins_nodelet_params(const ParamReader& reader) {
  auto params = read_nodelet_params<GpsInsNodeletParams>(reader);
  forget_keys_of_other_stages(reader, params.unknown);
  for (std::string* frame : {&params.base_frame, &params.imu_frame, &params.fix_frame}) *frame = tf2_frame(*frame);
  if (params.base_frame.empty()) throw std::invalid_argument(reader.source() + ": base_frame is empty");
  if (params.base_frame == params.nodelet.world_frame) {
    throw std::invalid_argument(reader.source() + ": world_frame and base_frame are both " + params.base_frame);
  }
  if (!params.origin.empty()) parse_geodetic_position(params.origin, reader.source() + ": origin");
  return params;
}

}  // namespace situation_awareness
