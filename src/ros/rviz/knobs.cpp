// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/knobs.hpp"

#include <algorithm>
#include <sstream>
#include <tuple>

namespace situation_awareness {
namespace {

using dynamic_reconfigure::Config;

template <class Parameters>
auto find(const Parameters& parameters, const std::string& name) {
  return std::find_if(parameters.begin(), parameters.end(),
                      [&name](const auto& parameter) { return parameter.name == name; });
}

template <class Parameter, class Value>
Parameter parameter_of(const std::string& name, const Value& value) {
  Parameter parameter;
  parameter.name = name;
  parameter.value = value;
  return parameter;
}

}  // namespace

bool operator==(const Knob& a, const Knob& b) {
  return std::tie(a.name, a.description, a.value, a.low, a.high) ==
         std::tie(b.name, b.description, b.value, b.low, b.high);
}

std::optional<KnobValue> value_in(const Config& config, const std::string& name) {
  if (const auto it = find(config.bools, name); it != config.bools.end()) return KnobValue(it->value != 0);
  if (const auto it = find(config.ints, name); it != config.ints.end()) return KnobValue(it->value);
  if (const auto it = find(config.doubles, name); it != config.doubles.end()) return KnobValue(it->value);
  if (const auto it = find(config.strs, name); it != config.strs.end()) return KnobValue(it->value);
  return {};
}

std::vector<Knob> knobs_of(const dynamic_reconfigure::ConfigDescription& description) {
  std::vector<Knob> knobs;
  for (const dynamic_reconfigure::Group& group : description.groups) {
    for (const dynamic_reconfigure::ParamDescription& parameter : group.parameters) {
      const auto value = value_in(description.dflt, parameter.name);
      const auto low = value_in(description.min, parameter.name);
      const auto high = value_in(description.max, parameter.name);
      if (!value || !low || !high || low->index() != value->index() || high->index() != value->index()) continue;
      knobs.push_back({parameter.name, parameter.description, *value, *low, *high});
    }
  }
  return knobs;
}

Config config_of(const std::string& name, const KnobValue& value) {
  using namespace dynamic_reconfigure;
  Config config;
  if (const auto* flag = std::get_if<bool>(&value)) config.bools = {parameter_of<BoolParameter>(name, *flag)};
  if (const auto* number = std::get_if<int>(&value)) config.ints = {parameter_of<IntParameter>(name, *number)};
  if (const auto* number = std::get_if<double>(&value)) config.doubles = {parameter_of<DoubleParameter>(name, *number)};
  if (const auto* text = std::get_if<std::string>(&value)) config.strs = {parameter_of<StrParameter>(name, *text)};
  return config;
}

std::string text_of(const KnobValue& value) {
  if (const auto* flag = std::get_if<bool>(&value)) return *flag ? "true" : "false";
  if (const auto* text = std::get_if<std::string>(&value)) return *text;
  std::ostringstream digits;
  digits.precision(9);
  if (const auto* number = std::get_if<int>(&value)) digits << *number;
  if (const auto* number = std::get_if<double>(&value)) digits << *number;
  return digits.str();
}

}  // namespace situation_awareness
