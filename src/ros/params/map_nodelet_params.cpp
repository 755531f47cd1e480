// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/map_nodelet_params.hpp"

#include <exception>
#include <stdexcept>

#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"
#include "situation_awareness/ros/params/object_nodelet_params.hpp"
#include "situation_awareness/ros/params/shared_file.hpp"

namespace situation_awareness {

MapNodeletParams read_map_nodelet_params(const ParamReader& reader) {
  auto params = read_nodelet_params<MapNodeletParams>(reader);
  forget_keys_of_other_stages(reader, params.unknown);
  try {
    map_kinds_of(params.kinds);
  } catch (const std::exception& error) {
    throw std::invalid_argument(reader.source() + ": kinds: " + error.what());
  }
  return params;
}

MapNodeletParams read_inertial_map_nodelet_params(const ParamReader& reader) {
  MapNodeletParams params = read_map_nodelet_params(reader);
  check_inertial_params(params.inertial, reader.source());
  const MapKinds kinds = map_kinds_of(params.kinds);
  if (kinds.targets) {
    throw std::invalid_argument(reader.source() + ": kinds: grid needs poses that TF knows to centimetres");
  }
  if (kinds.objects) params.objects = read_object_nodelet_params(reader).pipeline;
  return params;
}

}  // namespace situation_awareness
