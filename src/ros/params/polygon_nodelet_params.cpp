// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/polygon_nodelet_params.hpp"

#include "situation_awareness/ros/params/shared_file.hpp"

namespace situation_awareness {

PolygonNodeletParams read_polygon_nodelet_params(const ParamReader& reader) {
  auto params = read_nodelet_params<PolygonNodeletParams>(reader);
  forget_keys_of_other_stages(reader, params.unknown);
  return params;
}

}  // namespace situation_awareness
