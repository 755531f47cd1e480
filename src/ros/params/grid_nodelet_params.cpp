// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/grid_nodelet_params.hpp"

#include <stdexcept>

#include "situation_awareness/ros/params/shared_file.hpp"

namespace situation_awareness {

GridNodeletParams read_grid_nodelet_params(const ParamReader& reader) {
  auto params = read_nodelet_params<GridNodeletParams>(reader);
  forget_keys_of_other_stages(reader, params.unknown);
  if (params.elevation.dem.empty()) {
    throw std::invalid_argument(reader.source() + ": dem is empty, the path of an elevation");
  }
  return params;
}

}  // namespace situation_awareness
