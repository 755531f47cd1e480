// SPDX-License-Identifier: BSD-3-Clause
// Any text as the file of parameters.
#include <iomanip>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>

#include "input.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"

namespace situation_awareness::fuzz {
namespace {

/// Writes the fields of one params struct as YAML, such that they read back as they are.
class WriteFields {
 public:
  WriteFields(std::ostringstream& text, const char* indent) : text_(text), indent_(indent) {
    text_ << std::setprecision(std::numeric_limits<double>::max_digits10);
  }

  template <class Number>
  void operator()(const char* name, Number value, Bounds /*bounds*/, const char* /*unit*/, const char* /*doc*/) {
    text_ << indent_ << name << ": " << value << '\n';
  }

  void operator()(const char* name, const std::string& value, const char* /*doc*/) {
    static const char* const kDigits = "0123456789abcdef";
    text_ << indent_ << name << ": \"";
    for (const char c : value) text_ << "\\x" << kDigits[(c >> 4) & 15] << kDigits[c & 15];
    text_ << "\"\n";
  }

  void operator()(const char* name, const std::vector<HalfSpace>& value, const char* /*doc*/) {
    text_ << indent_ << name << ": [";
    for (const HalfSpace& half_space : value) {
      const Eigen::Vector3d& n = half_space.normal_world;
      text_ << '[' << n.x() << ", " << n.y() << ", " << n.z() << ", " << half_space.offset_m << "], ";
    }
    text_ << "]\n";
  }

 private:
  std::ostringstream& text_;
  const char* indent_;
};

std::string written(const ObjectPipelineParams& params) {
  std::ostringstream text;
  text << "scan:\n";
  RangeLimiterParams::fields(params.scan, WriteFields(text, "  "));
  text << "segments:\n";
  SegmentationParams::fields(params.segments, WriteFields(text, "  "));
  text << "objects:\n";
  ObjectMapParams::fields(params.objects, WriteFields(text, "  "));
  text << "detections:\n";
  DetectionParams::fields(params.detections, WriteFields(text, "  "));
  text << "  fit:\n";
  EllipseFitParams::fields(params.detections.fit, WriteFields(text, "    "));
  return text.str();
}

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
  params.scan.validate();
  params.segments.validate();
  params.detections.validate();
  params.objects.validate();
  if (is_ascii(params.detections.model)) {
    const std::string text = written(params);
    require(written(parse_object_pipeline_params(text, "again.yaml", "models")) == text, "what is written reads back");
  }

  // What is accepted can run.
  params.detections.detector = "least_squares";
  params.detections.model.clear();
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
