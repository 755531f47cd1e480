// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/nodelet_params.hpp"

#include <algorithm>
#include <stdexcept>

#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/params/package.hpp"

namespace situation_awareness {
namespace {

struct TakeFields {
  ParamReader& reader;

  void operator()(const char* name, double& value, Bounds bounds, const char* unit, const char* /*doc*/) const {
    value = reader.take_number(name, value, bounds, unit);
  }
  void operator()(const char* name, int& value, Bounds bounds, const char* unit, const char* /*doc*/) const {
    value = reader.take_integer(name, value, bounds, unit);
  }
  void operator()(const char* name, bool& value, const char* /*doc*/) const { value = reader.take_flag(name, value); }
  void operator()(const char* name, std::string& value, const char* /*doc*/) const {
    value = reader.take_text(name, value);
  }
};

}  // namespace

NodeletParams read_nodelet_params(ParamReader reader) {
  NodeletParams params;
  NodeletParams::fields(params, TakeFields{reader});
  params.world_frame = tf2_frame(params.world_frame);
  if (params.world_frame.empty()) throw std::invalid_argument(reader.source() + ": world_frame is empty");
  reader.skip("live");  // LiveParams'
  if (params.model_folder.empty()) params.model_folder = package_folder() + "/models";
  const auto on_unknown_key = [&](const UnknownKey& key) {
    params.unknown.push_back(key);
    if (key.path.find('.') != std::string::npos) return;
    std::vector<std::string>& known = params.unknown.back().known;
    known.insert(known.end(), reader.known().begin(), reader.known().end());
    std::sort(known.begin(), known.end());
  };
  params.pipeline =
      parse_object_pipeline_params(reader.rest_as_yaml(), reader.source(), params.model_folder, on_unknown_key);
  return params;
}

}  // namespace situation_awareness
