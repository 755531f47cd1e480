// SPDX-License-Identifier: BSD-3-Clause
#include <fstream>
#include <set>
#include <sstream>
#include <stdexcept>

#include <yaml-cpp/yaml.h>

#include "situation_awareness/pipeline/object_pipeline.hpp"

namespace situation_awareness {
namespace {

[[noreturn]] void fail(const std::string& source, const std::string& reason) {
  throw std::invalid_argument(source + ": " + reason);
}

/// Reads the fields of one params struct from one YAML map, and notes which keys it knows.
class ReadFields {
 public:
  ReadFields(const YAML::Node& node, std::string section, std::string source)
      : node_(node), section_(std::move(section)), source_(std::move(source)) {
    if (!node_.IsNull() && !node_.IsMap()) fail(source_, section_ + " must be a map of parameters");
  }

  void operator()(const char* name, double& value, Bounds bounds, const char* unit, const char* /*doc*/) {
    read(name, value, "a number in " + text_of(bounds, unit));
  }

  void operator()(const char* name, int& value, Bounds bounds, const char* unit, const char* /*doc*/) {
    read(name, value, "a whole number in " + text_of(bounds, unit));
  }

  void operator()(const char* name, std::string& value, const char* /*doc*/) { read(name, value, "a text"); }

  void operator()(const char* name, std::vector<HalfSpace>& value, const char* /*doc*/) {
    known_.insert(name);
    if (!has(name)) return;
    try {
      value = volume_from_yaml(YAML::Dump(node_[name]));
    } catch (const std::invalid_argument& error) {
      fail(source_, error.what());
    }
  }

  /// A nested map, read by its own struct; null where it is left out.
  YAML::Node nested(const char* name) {
    known_.insert(name);
    return has(name) ? node_[name] : YAML::Node();
  }

  void refuse_unknown_keys() const {
    if (!node_.IsMap()) return;
    for (const auto& item : node_) {
      if (!item.first.IsScalar()) {
        fail(source_, "the name of a parameter" + (section_.empty() ? "" : " in " + section_) + " must be a text");
      }
      const auto key = item.first.as<std::string>();
      if (known_.count(key) != 0) continue;
      std::string names;
      for (const std::string& name : known_) names += (names.empty() ? "" : ", ") + name;
      fail(source_, "unknown parameter " + path_of(key) + ", known are: " + names);
    }
  }

 private:
  static std::string text_of(Bounds bounds, const char* unit) {
    std::ostringstream text;
    text << '[' << bounds.low << ", " << bounds.high << ']' << (*unit != '\0' ? " " : "") << unit;
    return text.str();
  }

  std::string path_of(const std::string& key) const { return section_.empty() ? key : section_ + "." + key; }

  bool has(const char* name) const { return node_.IsMap() && node_[name].IsDefined(); }

  template <class Value>
  void read(const char* name, Value& value, const std::string& wanted) {
    known_.insert(name);
    if (!has(name)) return;
    try {
      value = node_[name].as<Value>();
    } catch (const YAML::Exception&) {
      fail(source_, path_of(name) + " must be " + wanted);
    }
  }

  const YAML::Node node_;
  std::string section_;
  std::string source_;
  std::set<std::string> known_;
};

template <class Params>
void read_section(ReadFields& parent, const char* name, Params& params, const std::string& source) {
  ReadFields fields(parent.nested(name), name, source);
  Params::fields(params, fields);
  fields.refuse_unknown_keys();
}

}  // namespace

ObjectPipelineParams parse_object_pipeline_params(const std::string& yaml, const std::string& source,
                                                  const std::string& model_folder) {
  YAML::Node root;
  try {
    root = YAML::Load(yaml);
  } catch (const YAML::Exception& error) {
    fail(source, std::string("not valid YAML: ") + error.what());
  }

  ObjectPipelineParams params;
  ReadFields sections(root, "", source);
  read_section(sections, "scan", params.scan, source);
  read_section(sections, "segments", params.segments, source);
  read_section(sections, "objects", params.objects, source);

  ReadFields detections(sections.nested("detections"), "detections", source);
  DetectionParams::fields(params.detections, detections);
  ReadFields fit(detections.nested("fit"), "detections.fit", source);
  EllipseFitParams::fields(params.detections.fit, fit);
  fit.refuse_unknown_keys();
  detections.refuse_unknown_keys();
  sections.refuse_unknown_keys();

  params.detections.model_folder = model_folder;
  try {
    params.scan.validate();
    params.segments.validate();
    params.detections.validate();
    params.objects.validate();
  } catch (const std::invalid_argument& error) {
    fail(source, error.what());
  }
  return params;
}

ObjectPipelineParams load_object_pipeline_params(const std::string& path, const std::string& model_folder) {
  std::ifstream file(path);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) throw std::invalid_argument(path + ": cannot be read");
  return parse_object_pipeline_params(text.str(), path, model_folder);
}

}  // namespace situation_awareness
