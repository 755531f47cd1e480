// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/splinegon_nodelet_params.hpp"

#include <stdexcept>
#include <string>

#include "situation_awareness/pose/local_world.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/params/shared_file.hpp"

namespace situation_awareness {

GpsInsNodeletParams gps_ins_params_of(const SplinegonNodeletParams& params) {
  GpsInsNodeletParams result;
  result.nodelet = params.nodelet;
  result.base_frame = params.base_frame;
  result.imu_frame = params.imu_frame;
  result.fix_frame = params.fix_frame;
  result.origin = params.origin;
  result.fix_sigma_m = params.fix_sigma_m;
  result.gps_ins = params.gps_ins;
  return result;
}

SplinegonNodeletParams read_splinegon_nodelet_params(const ParamReader& reader) {
  auto params = read_nodelet_params<SplinegonNodeletParams>(reader);
  forget_keys_of_other_stages(reader, params.unknown);
  for (std::string* frame : {&params.base_frame, &params.imu_frame, &params.fix_frame}) *frame = tf2_frame(*frame);
  if (params.base_frame.empty()) throw std::invalid_argument(reader.source() + ": base_frame is empty");
  if (!params.origin.empty()) parse_geodetic_position(params.origin, reader.source() + ": origin");
  if (params.localization != "gps" && params.localization != "tf") {
    throw std::invalid_argument(reader.source() + ": localization = " + params.localization + " is not gps or tf");
  }
  return params;
}

}  // namespace situation_awareness
