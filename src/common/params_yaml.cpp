// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/params_yaml.hpp"

#include <algorithm>

#include <yaml-cpp/yaml.h>

#include "situation_awareness/common/canonical_yaml.hpp"
#include "situation_awareness/common/file.hpp"
#include "situation_awareness/common/yaml_defect.hpp"

namespace situation_awareness {
namespace {

std::string joined(const std::string& section, const std::string& name) {
  return section.empty() ? name : section + '.' + name;
}

/// The key below `section` on the path of `parameter`; empty if it is elsewhere.
std::string key_below(const std::string& section, const Parameter& parameter) {
  if (parameter.section == section) return parameter.name;
  const std::string prefix = section.empty() ? "" : section + '.';
  if (parameter.section.compare(0, prefix.size(), prefix) != 0) return "";
  return parameter.section.substr(prefix.size(), parameter.section.find('.', prefix.size()) - prefix.size());
}

/// For messages: one short line.
std::string shown(const YAML::Node& node) {
  if (node.IsMap()) return "a map";
  if (node.IsSequence()) return "a list";
  if (!node.IsScalar()) return "null";
  constexpr std::size_t kMaxLength = 60;
  const std::string& text = node.Scalar();
  const bool plain = node.Tag() == "?" && !text.empty();
  std::string line = plain ? text : yaml_text(text);
  if (line.size() > kMaxLength) line = line.substr(0, kMaxLength) + "...";
  std::replace(line.begin(), line.end(), '\n', ' ');
  return line;
}

template <class Value>
bool converts(const YAML::Node& node) {
  Value value;
  return YAML::convert<Value>::decode(node, value);
}

/// By the rules of YAML 3 is a number and yes is a bool; "3" and 'yes' are texts.
bool is_text(const YAML::Node& node) {
  if (!node.IsScalar()) return false;
  return node.Tag() != "?" || !(converts<bool>(node) || converts<double>(node));
}

class YamlReader {
 public:
  YamlReader(const std::vector<Parameter>& parameters, const std::string& source, const OnUnknownKey& on_unknown_key)
      : parameters_(parameters), source_(source), on_unknown_key_(on_unknown_key) {}

  void read(const YAML::Node& node, const std::string& section) const {
    if (node.IsNull()) return;
    if (!node.IsMap()) fail((section.empty() ? "the parameters" : section) + " must be a map, not " + shown(node));
    std::vector<std::string> unknown;
    for (const auto& item : node) {
      const std::string& key = item.first.Scalar();
      const auto of_key = [&](const Parameter& p) { return !key.empty() && key_below(section, p) == key; };
      const auto parameter = std::find_if(parameters_.begin(), parameters_.end(), of_key);
      if (parameter == parameters_.end()) {
        unknown.push_back(key);
      } else if (parameter->section == section) {
        set(*parameter, item.second);
      } else {
        read(item.second, joined(section, key));
      }
    }
    for (const std::string& key : unknown) on_unknown_key_({source_, joined(section, key), known_in(section)});
  }

  [[noreturn]] void fail(const std::string& reason) const { throw std::invalid_argument(source_ + ": " + reason); }

 private:
  std::vector<std::string> known_in(const std::string& section) const {
    std::set<std::string> known;
    for (const Parameter& parameter : parameters_) known.insert(key_below(section, parameter));
    known.erase("");
    return {known.begin(), known.end()};
  }

  void set(const Parameter& parameter, const YAML::Node& node) const {
    std::visit([&](const auto& value) { set_value(parameter, node, value); }, parameter.value);
  }

  [[noreturn]] void refuse(const Parameter& parameter, const YAML::Node& node, const std::string& wanted) const {
    fail(parameter.path() + " = " + shown(node) + " must be " + wanted);
  }

  template <class Number>
  void set_number(const Parameter& parameter, const YAML::Node& node, Number* value, const std::string& kind) const {
    const std::string range = text_of(*parameter.bounds, parameter.unit);
    if (!node.IsScalar() || !YAML::convert<Number>::decode(node, *value)) refuse(parameter, node, kind + range);
    const auto number = static_cast<double>(*value);
    if (number >= parameter.bounds->low && number <= parameter.bounds->high) return;  // false for NaN
    fail(parameter.path() + " = " + yaml_text(*value) + " is outside " + range);
  }

  void set_value(const Parameter& parameter, const YAML::Node& node, double* value) const {
    set_number(parameter, node, value, "a number in ");
  }

  void set_value(const Parameter& parameter, const YAML::Node& node, int* value) const {
    set_number(parameter, node, value, "a whole number in ");
  }

  void set_value(const Parameter& parameter, const YAML::Node& node, bool* value) const {
    if (!node.IsScalar() || node.Tag() != "?" || !YAML::convert<bool>::decode(node, *value)) {
      refuse(parameter, node, "true or false");
    }
  }

  void set_value(const Parameter& parameter, const YAML::Node& node, std::string* value) const {
    if (!is_text(node)) refuse(parameter, node, "a text");
    *value = node.Scalar();
  }

  void set_value(const Parameter& parameter, const YAML::Node& node, const YamlValue& value) const {
    try {
      value.set(YAML::Dump(node));
    } catch (const std::invalid_argument& error) {
      fail(parameter.path() + ' ' + error.what());
    }
  }

  const std::vector<Parameter>& parameters_;
  const std::string& source_;
  const OnUnknownKey& on_unknown_key_;
};

/// Writes the contents of `section`, its own parameters before its sections.
void write(const std::vector<Parameter>& parameters, const std::string& section, const std::string& indent,
           std::string& text) {
  std::vector<std::string> sections;
  for (const Parameter& parameter : parameters) {
    const std::string key = key_below(section, parameter);
    if (key.empty()) continue;
    if (parameter.section == section) {
      text += indent + key + ": " + yaml_text(parameter) + '\n';
    } else if (std::find(sections.begin(), sections.end(), key) == sections.end()) {
      sections.push_back(key);
    }
  }
  for (const std::string& key : sections) {
    text += indent + key + ":\n";
    write(parameters, joined(section, key), indent + "  ", text);
  }
}

}  // namespace

void read_yaml(const std::vector<Parameter>& parameters, const std::string& yaml, const std::string& source,
               const OnUnknownKey& on_unknown_key) {
  const YamlReader reader(parameters, source, on_unknown_key);
  YAML::Node root;
  try {
    root = YAML::Load(canonical_yaml(yaml));
  } catch (const std::invalid_argument& error) {
    reader.fail(error.what());
  } catch (const YAML::Exception& error) {
    reader.fail(yaml_defect(error));
  }
  reader.read(root, "");
}

std::string yaml_of(const std::vector<Parameter>& parameters) {
  std::string text;
  write(parameters, "", "", text);
  return text;
}

std::string read_text_file(const std::string& path) try {
  return read_file(path, kMaxTextBytes);
} catch (const std::runtime_error& error) {
  throw std::invalid_argument(error.what());
}

}  // namespace situation_awareness
