// SPDX-License-Identifier: BSD-3-Clause
// Any text as the file of parameters.
#include <limits>
#include <stdexcept>
#include <string>

#include "input.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"

namespace situation_awareness::fuzz {
namespace {

bool is_ascii(const std::string& text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c > 0; });
}

void run(const std::string& yaml) {
  ObjectPipelineParams params;
  try {
    params = parse_object_pipeline_params(yaml, "fuzz.yaml", "models");
  } catch (const std::invalid_argument& error) {
    const std::string sentence = error.what();
    require(sentence.rfind("fuzz.yaml: ", 0) == 0 && sentence.size() > 11, "a refusal names the file and the reason");
    return;
  }
  validate_all(params);
  if (is_ascii(params.detections.model)) {
    const std::string text = yaml_from_params(params);
    require(yaml_from_params(parse_object_pipeline_params(text, "again.yaml", "models")) == text,
            "what is written reads back");
  }

  // Accepted parameters can run.
  params.detections.detector = "least_squares";
  params.detections.model.clear();
  params.detections.boxes = false;
  ObjectPipeline pipeline(params);
  Scan scan;
  scan.angle_min_rad = -1.0;
  scan.angle_increment_rad = 0.02;
  scan.beams.assign(100, {std::numeric_limits<float>::infinity(), BeamState::kFree});
  for (std::size_t i = 40; i < 60; ++i) {
    scan.beams[i] = {2.0F - 0.01F * static_cast<float>(std::min(i - 40, 60 - i)), BeamState::kHit};
  }
  pipeline.process(scan, Eigen::Isometry3d::Identity());
}

}  // namespace
}  // namespace situation_awareness::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  situation_awareness::fuzz::run({reinterpret_cast<const char*>(data), size});
  return 0;
}
