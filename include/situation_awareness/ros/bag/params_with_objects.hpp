// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "situation_awareness/common/file.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/ros/params/package.hpp"

namespace situation_awareness {

/// Reads parameters from a YAML file that has those of objects, too: a key is unknown, and warned of, where neither
/// knows it. `model_folder`: of relative models; where it is empty, and `with_objects`, models/ of this package. Throws
/// as params_from_yaml and parse_object_pipeline_params.
template <class Params>
Params params_with_objects(const std::string& path, std::string model_folder, bool with_objects,
                           ObjectPipelineParams& objects) {
  const std::string yaml = read_text_file(path);
  std::vector<UnknownKey> unknown;
  std::vector<std::string> unknown_to_objects;
  Params params = params_from_yaml<Params>(yaml, path, [&unknown](const UnknownKey& key) { unknown.push_back(key); });
  if (model_folder.empty() && with_objects) model_folder = package_folder() + "/models";
  objects = parse_object_pipeline_params(yaml, path, model_folder,
                                         [&](const UnknownKey& key) { unknown_to_objects.push_back(key.path); });
  for (const UnknownKey& key : unknown) {
    const bool known = std::none_of(
        unknown_to_objects.begin(), unknown_to_objects.end(),
        [&key](const std::string& other) { return key.path == other || key.path.rfind(other + ".", 0) == 0; });
    if (!known) print_warning(key);
  }
  return params;
}

}  // namespace situation_awareness
