// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/live_params.hpp"

#include <algorithm>
#include <exception>
#include <set>
#include <stdexcept>
#include <variant>

#include <dynamic_reconfigure/config_tools.h>
#include <ros/console.h>

namespace situation_awareness {
namespace {

using dynamic_reconfigure::Config;
using dynamic_reconfigure::ConfigTools;

template <class... Functions>
struct Overloaded : Functions... {
  using Functions::operator()...;
};
template <class... Functions>
Overloaded(Functions...) -> Overloaded<Functions...>;

/// dynamic_reconfigure shows parameters in groups; the first is for those of no group.
dynamic_reconfigure::GroupState state_of_only_group() {
  dynamic_reconfigure::GroupState state;
  state.name = "Default";
  state.state = true;
  return state;
}

/// Adds a bound; parameters without one get the bounds of generated servers.
void append_bound(Config& config, const Parameter& parameter, double Bounds::*end) {
  const auto bound = [&] { return (*parameter.bounds).*end; };
  const bool is_high = end == &Bounds::high;
  std::visit(Overloaded{[&](bool*) { ConfigTools::appendParameter(config, parameter.name, is_high); },
                        [&](int*) { ConfigTools::appendParameter(config, parameter.name, static_cast<int>(bound())); },
                        [&](double*) { ConfigTools::appendParameter(config, parameter.name, bound()); },
                        [&](const auto&) { ConfigTools::appendParameter(config, parameter.name, std::string()); }},
             parameter.value);
}

std::string type_of(const Parameter& parameter) {
  return std::visit(Overloaded{[](bool*) { return "bool"; }, [](int*) { return "int"; },
                               [](double*) { return "double"; }, [](const auto&) { return "str"; }},
                    parameter.value);
}

template <class Number>
bool set_number(const Parameter& parameter, const Config& config, Number* value) {
  if (!ConfigTools::getParameter(config, parameter.name, *value)) return false;
  // std::clamp keeps NaN, which validate() refuses.
  *value = std::clamp(*value, static_cast<Number>(parameter.bounds->low), static_cast<Number>(parameter.bounds->high));
  return true;
}

/// False if `config` has no such parameter of its type.
bool set(const Parameter& parameter, const Config& config) {
  return std::visit(Overloaded{[&](int* value) { return set_number(parameter, config, value); },
                               [&](double* value) { return set_number(parameter, config, value); },
                               [&](const YamlValue& value) {
                                 std::string yaml;
                                 if (!ConfigTools::getParameter(config, parameter.name, yaml)) return false;
                                 try {
                                   value.set(yaml);
                                 } catch (const std::invalid_argument& error) {
                                   throw std::invalid_argument(parameter.path() + ' ' + error.what());
                                 }
                                 return true;
                               },
                               [&](auto* value) { return ConfigTools::getParameter(config, parameter.name, *value); }},
                    parameter.value);
}

using NamedTexts = std::vector<std::pair<std::string, std::string>>;

NamedTexts texts_of(const std::vector<Parameter>& parameters) {
  NamedTexts texts;
  for (const Parameter& parameter : parameters) texts.emplace_back(parameter.name, yaml_text(parameter));
  return texts;
}

/// "a = 1, b = 2"
std::string listed(const NamedTexts& texts) {
  std::string list;
  for (const auto& [name, text] : texts) list += (list.empty() ? "" : ", ") + name + " = " + text;
  return list;
}

/// "a = 1 (WORD 3), ...": the values that differ from `before`, which has the same names; empty if none does.
std::string changes(const NamedTexts& before, const NamedTexts& now, const std::string& word) {
  NamedTexts changed;
  for (std::size_t i = 0; i < now.size(); ++i) {
    const auto& [name, text] = now[i];
    if (before[i].second != text) changed.emplace_back(name, text + " (" + word + " " + before[i].second + ")");
  }
  return listed(changed);
}

}  // namespace

std::vector<Parameter> live_parameters(const std::vector<Parameter>& parameters) {
  std::vector<Parameter> live;
  std::set<std::string> names;
  for (const Parameter& parameter : parameters) {
    if (!parameter.live) continue;
    if (!names.insert(parameter.name).second) throw std::logic_error("two live parameters named " + parameter.name);
    live.push_back(parameter);
  }
  return live;
}

Config config_of(const std::vector<Parameter>& parameters) {
  Config config;
  for (const Parameter& parameter : parameters) {
    std::visit(
        Overloaded{[&](const YamlValue& value) { ConfigTools::appendParameter(config, parameter.name, value.get()); },
                   [&](const auto* value) { ConfigTools::appendParameter(config, parameter.name, *value); }},
        parameter.value);
  }
  config.groups.push_back(state_of_only_group());
  return config;
}

dynamic_reconfigure::ConfigDescription description_of(const std::vector<Parameter>& parameters) {
  dynamic_reconfigure::ConfigDescription description;
  dynamic_reconfigure::Group group;
  group.name = state_of_only_group().name;
  for (const Parameter& parameter : parameters) {
    dynamic_reconfigure::ParamDescription entry;
    entry.name = parameter.name;
    entry.type = type_of(parameter);
    entry.description = parameter.doc + (parameter.unit.empty() ? "" : " [" + parameter.unit + "]");
    group.parameters.push_back(entry);
    append_bound(description.min, parameter, &Bounds::low);
    append_bound(description.max, parameter, &Bounds::high);
  }
  description.groups.push_back(group);
  description.min.groups.push_back(state_of_only_group());
  description.max.groups.push_back(state_of_only_group());
  description.dflt = config_of(parameters);
  return description;
}

std::vector<std::string> set_from_config(const std::vector<Parameter>& parameters, const Config& config) {
  std::set<std::string> taken;
  for (const Parameter& parameter : parameters) {
    if (set(parameter, config)) taken.insert(type_of(parameter) + ' ' + parameter.name);
  }
  std::vector<std::string> left;
  const auto find_unknown = [&](const auto& entries, const std::string& type) {
    for (const auto& entry : entries) {
      if (taken.count(type + ' ' + entry.name) == 0) left.push_back(entry.name);
    }
  };
  find_unknown(config.bools, "bool");
  find_unknown(config.ints, "int");
  find_unknown(config.doubles, "double");
  find_unknown(config.strs, "str");
  return left;
}

LiveParamsServer::LiveParamsServer(const ros::NodeHandle& node, const std::string& name,
                                   const std::vector<Parameter>& parameters, const std::vector<Parameter>& defaults,
                                   std::function<void()> use)
    : node_(node), name_(name), parameters_(parameters), description_(description_of(defaults)), use_(std::move(use)) {
  const Config yaml = config_of(parameters_);
  const NamedTexts yaml_texts = texts_of(parameters_);
  try {
    set_from_config(parameters_, from_parameter_server());
    use_();
  } catch (const std::exception& error) {
    ROS_WARN_STREAM(name_ << ": the values in " << node_.getNamespace() << " are not used: " << error.what());
    set_from_config(parameters_, yaml);
    use_();
  }
  to_parameter_server();
  const NamedTexts texts = texts_of(parameters_);
  ROS_INFO_STREAM(name_ << ": live parameters: " << listed(texts));
  const std::string others = changes(yaml_texts, texts, "YAML:");
  if (!others.empty()) ROS_INFO_STREAM(name_ << ": changed live before: " << others);
}

Config LiveParamsServer::from_parameter_server() const {
  Config config;
  for (const Parameter& parameter : parameters_) {
    const auto take = [&](auto value) {
      if (node_.getParam(parameter.name, value)) ConfigTools::appendParameter(config, parameter.name, value);
    };
    std::visit(Overloaded{[&](const YamlValue&) { take(std::string()); }, [&](const auto* value) { take(*value); }},
               parameter.value);
  }
  return config;
}

void LiveParamsServer::to_parameter_server() const {
  for (const Parameter& parameter : parameters_) {
    std::visit(Overloaded{[&](const YamlValue& value) { node_.setParam(parameter.name, value.get()); },
                          [&](const auto* value) { node_.setParam(parameter.name, *value); }},
               parameter.value);
  }
}

void LiveParamsServer::serve() {
  try {
    service_ = node_.advertiseService("set_parameters", &LiveParamsServer::change, this);
    const bool latch = true;
    descriptions_ = node_.advertise<dynamic_reconfigure::ConfigDescription>("parameter_descriptions", 1, latch);
    updates_ = node_.advertise<Config>("parameter_updates", 1, latch);
    descriptions_.publish(description_);
    updates_.publish(config_of(parameters_));
  } catch (const std::exception& error) {
    ROS_ERROR_STREAM(name_ << ": no live parameters: " << error.what());
  }
}

bool LiveParamsServer::change(dynamic_reconfigure::ReconfigureRequest& request,
                              dynamic_reconfigure::ReconfigureResponse& response) {
  const Config before = config_of(parameters_);
  const NamedTexts texts_before = texts_of(parameters_);
  try {
    for (const std::string& name : set_from_config(parameters_, request.config)) {
      ROS_WARN_STREAM(name_ << ": no live parameter of this name and type: " << name);
    }
    use_();
    const std::string what = changes(texts_before, texts_of(parameters_), "was");
    if (!what.empty()) ROS_INFO_STREAM(name_ << ": " << what);
  } catch (const std::exception& error) {
    set_from_config(parameters_, before);
    ROS_WARN_STREAM(name_ << ": live change refused, the old values stay: " << error.what());
  }
  to_parameter_server();
  response.config = config_of(parameters_);
  updates_.publish(response.config);
  return true;
}

}  // namespace situation_awareness
