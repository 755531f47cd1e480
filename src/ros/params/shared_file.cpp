// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/shared_file.hpp"

#include <algorithm>
#include <exception>
#include <string>

#include "situation_awareness/ros/params/circumnavigate_nodelet_params.hpp"
#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"
#include "situation_awareness/ros/params/grid_nodelet_params.hpp"
#include "situation_awareness/ros/params/image_labelling_nodelet_params.hpp"
#include "situation_awareness/ros/params/localization_nodelet_params.hpp"
#include "situation_awareness/ros/params/map_nodelet_params.hpp"
#include "situation_awareness/ros/params/object_nodelet_params.hpp"
#include "situation_awareness/ros/params/path_nodelet_params.hpp"
#include "situation_awareness/ros/params/scout_nodelet_params.hpp"

namespace situation_awareness {
namespace {

template <class Other>
void forget_known_to(const ParamReader& reader, std::vector<UnknownKey>& unknown) {
  if (unknown.empty()) return;
  std::vector<std::string> unknown_to_other;
  try {
    reader.read<Other>([&unknown_to_other](const UnknownKey& key) { unknown_to_other.push_back(key.path); });
  } catch (const std::exception&) {
    return;  // the other stage refuses to start, and says why
  }
  const auto knows = [&unknown_to_other](const UnknownKey& key) {
    return std::none_of(unknown_to_other.begin(), unknown_to_other.end(), [&key](const std::string& path) {
      return key.path == path || key.path.rfind(path + ".", 0) == 0;  // or in a section that is unknown as a whole
    });
  };
  unknown.erase(std::remove_if(unknown.begin(), unknown.end(), knows), unknown.end());
}

}  // namespace

void forget_keys_of_other_stages(const ParamReader& reader, std::vector<UnknownKey>& unknown) {
  forget_known_to<ObjectNodeletParams>(reader, unknown);
  forget_known_to<LocalizationNodeletParams>(reader, unknown);
  forget_known_to<PathNodeletParams>(reader, unknown);
  forget_known_to<GpsInsNodeletParams>(reader, unknown);
  forget_known_to<CircumnavigateNodeletParams>(reader, unknown);
  forget_known_to<GridNodeletParams>(reader, unknown);
  forget_known_to<MapNodeletParams>(reader, unknown);
  forget_known_to<ImageLabellingNodeletParams>(reader, unknown);
  forget_known_to<ScoutNodeletParams>(reader, unknown);
}

}  // namespace situation_awareness
