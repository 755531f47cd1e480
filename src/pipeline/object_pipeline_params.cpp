// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"

namespace situation_awareness {

ObjectPipelineParams parse_object_pipeline_params(const std::string& yaml, const std::string& source,
                                                  const std::string& model_folder, const OnUnknownKey& on_unknown_key) {
  auto params = params_from_yaml<ObjectPipelineParams>(yaml, source, on_unknown_key);
  params.detections.model_folder = model_folder;
  return params;
}

ObjectPipelineParams load_object_pipeline_params(const std::string& path, const std::string& model_folder,
                                                 const OnUnknownKey& on_unknown_key) {
  return parse_object_pipeline_params(read_text_file(path), path, model_folder, on_unknown_key);
}

}  // namespace situation_awareness
