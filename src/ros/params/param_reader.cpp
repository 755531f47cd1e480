// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/param_reader.hpp"

#include <ros/node_handle.h>
#include <ros/param.h>

namespace situation_awareness {
namespace {

using XmlRpc::XmlRpcValue;

constexpr const char* kConfigYaml = "config_yaml";

XmlRpcValue private_tree(const ros::NodeHandle& private_node) {
  XmlRpcValue tree;
  ros::param::get(private_node.getNamespace(), tree);
  return tree;
}

}  // namespace

std::string yaml_from_xmlrpc(XmlRpcValue value) {
  std::string text;
  switch (value.getType()) {
    case XmlRpcValue::TypeBoolean:
      return yaml_text(static_cast<bool&>(value));
    case XmlRpcValue::TypeInt:
      return yaml_text(static_cast<int&>(value));
    case XmlRpcValue::TypeDouble:
      return yaml_text(static_cast<double&>(value));
    case XmlRpcValue::TypeString:
      return yaml_text(static_cast<std::string&>(value));
    case XmlRpcValue::TypeArray:
      for (int i = 0; i < value.size(); ++i) text += (i == 0 ? "" : ", ") + yaml_from_xmlrpc(value[i]);
      return "[" + text + "]";
    case XmlRpcValue::TypeStruct:
      for (auto& [name, member] : value) {
        text += (text.empty() ? "" : ", ") + yaml_text(name) + ": " + yaml_from_xmlrpc(member);
      }
      return "{" + text + "}";
    default:
      return "null";
  }
}

ParamReader::ParamReader(const ros::NodeHandle& private_node)
    : ParamReader(private_tree(private_node), "parameters of " + private_node.getNamespace()) {}

ParamReader::ParamReader(const XmlRpcValue& tree, const std::string& source) : source_(source) {
  XmlRpcValue parameters;  // without the text of the file: a struct cannot lose a member
  if (tree.getType() != XmlRpcValue::TypeStruct) {
    parameters = tree;
  } else {
    parameters.begin();  // makes an empty struct
    for (auto& [name, value] : XmlRpcValue(tree)) {
      if (name != kConfigYaml) {
        parameters[name] = value;
      } else if (value.getType() == XmlRpcValue::TypeString) {
        file_yaml_ = static_cast<std::string&>(value);
      }
    }
  }
  yaml_ = yaml_from_xmlrpc(parameters);
}

}  // namespace situation_awareness
