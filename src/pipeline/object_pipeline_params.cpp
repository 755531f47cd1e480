// SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
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

  void report_unknown_keys(const OnUnknownKey& on_unknown_key) const {
    if (!node_.IsMap()) return;
    for (const auto& item : node_) {
      if (!item.first.IsScalar()) {
        fail(source_, "the name of a parameter" + (section_.empty() ? "" : " in " + section_) + " must be a text");
      }
      const std::string& key = item.first.Scalar();
      if (known_.count(key) == 0) on_unknown_key({source_, path_of(key), {known_.begin(), known_.end()}});
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
void read_section(ReadFields& parent, const char* name, Params& params, const std::string& source,
                  const OnUnknownKey& on_unknown_key) {
  ReadFields fields(parent.nested(name), name, source);
  Params::fields(params, fields);
  fields.report_unknown_keys(on_unknown_key);
}

}  // namespace

std::string sentence_of(const UnknownKey& key) {
  std::string names;
  for (const std::string& name : key.known) names += (names.empty() ? "" : ", ") + name;
  return key.source + ": unknown parameter " + key.path + " has no effect, known are: " + names;
}

void warn_on_stderr(const UnknownKey& key) { std::fprintf(stderr, "warning: %s\n", sentence_of(key).c_str()); }

ObjectPipelineParams parse_object_pipeline_params(const std::string& yaml, const std::string& source,
                                                  const std::string& model_folder, const OnUnknownKey& on_unknown_key) {
  YAML::Node root;
  try {
    root = YAML::Load(yaml);
  } catch (const YAML::Exception& error) {
    fail(source, std::string("not valid YAML: ") + error.what());
  }

  ObjectPipelineParams params;
  ReadFields sections(root, "", source);
  read_section(sections, "scan", params.scan, source, on_unknown_key);
  read_section(sections, "segments", params.segments, source, on_unknown_key);
  read_section(sections, "objects", params.objects, source, on_unknown_key);

  ReadFields detections(sections.nested("detections"), "detections", source);
  DetectionParams::fields(params.detections, detections);
  ReadFields fit(detections.nested("fit"), "detections.fit", source);
  EllipseFitParams::fields(params.detections.fit, fit);
  fit.report_unknown_keys(on_unknown_key);
  detections.report_unknown_keys(on_unknown_key);
  sections.report_unknown_keys(on_unknown_key);

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

ObjectPipelineParams load_object_pipeline_params(const std::string& path, const std::string& model_folder,
                                                 const OnUnknownKey& on_unknown_key) {
  std::ifstream file(path);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) throw std::invalid_argument(path + ": cannot be read");
  return parse_object_pipeline_params(text.str(), path, model_folder, on_unknown_key);
}

}  // namespace situation_awareness
