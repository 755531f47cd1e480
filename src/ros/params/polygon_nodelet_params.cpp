// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/polygon_nodelet_params.hpp"

#include "situation_awareness/ros/params/object_nodelet_params.hpp"

namespace situation_awareness {

PolygonNodeletParams read_polygon_nodelet_params(const ParamReader& reader) {
  auto params = read_nodelet_params<PolygonNodeletParams>(reader);
  forget_known_to<ObjectNodeletParams>(reader, params.unknown);
  return params;
}

}  // namespace situation_awareness
