// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"

#include <stdexcept>

#include "situation_awareness/ros/params/shared_file.hpp"

namespace situation_awareness {

GpsInsNodeletParams gps_ins_params_of(const NodeletParams& nodelet, const InertialParams& inertial) {
  GpsInsNodeletParams result;
  result.nodelet = nodelet;
  result.base_frame = inertial.base_frame;
  result.imu_frame = inertial.imu_frame;
  result.fix_frame = inertial.fix_frame;
  result.origin = inertial.origin;
  result.fix_sigma_m = inertial.fix_sigma_m;
  result.gps_ins = inertial.gps_ins;
  return result;
}

GpsInsNodeletParams read_gps_ins_nodelet_params(const ParamReader& reader) {
  auto params = read_nodelet_params<GpsInsNodeletParams>(reader);
  forget_keys_of_other_stages(reader, params.unknown);
  check_inertial_params(params, reader.source());
  if (params.base_frame == params.nodelet.world_frame) {
    throw std::invalid_argument(reader.source() + ": world_frame and base_frame are both " + params.base_frame);
  }
  return params;
}

}  // namespace situation_awareness
