// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/splinegon_nodelet_params.hpp"

#include <stdexcept>

#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"
#include "situation_awareness/ros/params/shared_file.hpp"

namespace situation_awareness {

SplinegonNodeletParams read_splinegon_nodelet_params(const ParamReader& reader) {
  auto params = read_nodelet_params<SplinegonNodeletParams>(reader);
  forget_keys_of_other_stages(reader, params.unknown);
  check_inertial_params(params.inertial, reader.source());
  if (params.localization != "gps" && params.localization != "tf") {
    throw std::invalid_argument(reader.source() + ": localization = " + params.localization + " is not gps or tf");
  }
  return params;
}

}  // namespace situation_awareness
