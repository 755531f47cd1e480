// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/param_reader.hpp"

#include <cmath>
#include <cstdio>
#include <sstream>
#include <stdexcept>

#include <ros/node_handle.h>
#include <ros/param.h>

namespace situation_awareness {
namespace {

using XmlRpc::XmlRpcValue;

std::string double_quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      result += '\\';
      result += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      char escape[8];
      std::snprintf(escape, sizeof escape, "\\x%02x", static_cast<unsigned>(static_cast<unsigned char>(c)));
      result += escape;
    } else {
      result += c;
    }
  }
  return result + '"';
}

std::string number(double value) {
  if (std::isnan(value)) return ".nan";
  if (std::isinf(value)) return value > 0.0 ? ".inf" : "-.inf";
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

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
      return static_cast<bool&>(value) ? "true" : "false";
    case XmlRpcValue::TypeInt:
      return std::to_string(static_cast<int&>(value));
    case XmlRpcValue::TypeDouble:
      return number(static_cast<double&>(value));
    case XmlRpcValue::TypeString:
      return double_quoted(static_cast<std::string&>(value));
    case XmlRpcValue::TypeArray:
      for (int i = 0; i < value.size(); ++i) text += (i == 0 ? "" : ", ") + yaml_from_xmlrpc(value[i]);
      return "[" + text + "]";
    case XmlRpcValue::TypeStruct:
      for (auto& [name, member] : value) {
        text += (text.empty() ? "" : ", ") + double_quoted(name) + ": " + yaml_from_xmlrpc(member);
      }
      return "{" + text + "}";
    default:
      return "null";
  }
}

ParamReader::ParamReader(const ros::NodeHandle& private_node)
    : ParamReader(private_tree(private_node), "parameters of " + private_node.getNamespace()) {}

ParamReader::ParamReader(const XmlRpcValue& tree, const std::string& source) : tree_(tree), source_(source) {
  if (tree_.valid() && tree_.getType() != XmlRpcValue::TypeStruct) {
    throw std::invalid_argument(source_ + ": a map of names and values is expected, not " + yaml_from_xmlrpc(tree_));
  }
}

XmlRpcValue ParamReader::take(const std::string& name) {
  known_.push_back(name);
  if (!tree_.valid() || !tree_.hasMember(name)) return {};
  // XmlRpcValue cannot forget a member, so the rest is copied.
  XmlRpcValue value, rest;
  rest.begin();  // makes it a struct, even if it stays empty
  for (auto& [member_name, member] : tree_) (member_name == name ? value : rest[member_name]) = member;
  tree_ = rest;
  return value;
}

void ParamReader::skip(const std::string& name) {
  take(name);
  known_.pop_back();
}

void ParamReader::refuse(const std::string& name, const std::string& defect) const {
  throw std::invalid_argument(source_ + ": " + name + " " + defect);
}

double ParamReader::take_number(const std::string& name, double otherwise, Bounds bounds, const std::string& unit) {
  XmlRpcValue value = take(name);
  if (!value.valid()) return otherwise;
  double result = 0.0;
  if (value.getType() == XmlRpcValue::TypeInt) {
    result = static_cast<int&>(value);
  } else if (value.getType() == XmlRpcValue::TypeDouble) {
    result = static_cast<double&>(value);
  } else {
    refuse(name, "= " + yaml_from_xmlrpc(value) + " is not a number");
  }
  if (result >= bounds.low && result <= bounds.high) return result;  // false for NaN
  std::ostringstream defect;
  defect << "= " << result << " is outside [" << bounds.low << ", " << bounds.high << "]";
  refuse(name, defect.str() + (unit.empty() ? "" : " " + unit));
}

int ParamReader::take_integer(const std::string& name, int otherwise, Bounds bounds, const std::string& unit) {
  const double result = take_number(name, otherwise, bounds, unit);
  if (result != std::floor(result)) refuse(name, "= " + number(result) + " is not an integer");
  return static_cast<int>(result);
}

bool ParamReader::take_flag(const std::string& name, bool otherwise) {
  XmlRpcValue value = take(name);
  if (!value.valid()) return otherwise;
  if (value.getType() != XmlRpcValue::TypeBoolean)
    refuse(name, "= " + yaml_from_xmlrpc(value) + " is not true or false");
  return static_cast<bool&>(value);
}

std::string ParamReader::take_text(const std::string& name, const std::string& otherwise) {
  XmlRpcValue value = take(name);
  if (!value.valid()) return otherwise;
  if (value.getType() != XmlRpcValue::TypeString) refuse(name, "= " + yaml_from_xmlrpc(value) + " is not a text");
  return static_cast<std::string&>(value);
}

std::string ParamReader::rest_as_yaml() const { return tree_.valid() ? yaml_from_xmlrpc(tree_) : "{}"; }

void ParamReader::refuse_rest() const {
  XmlRpcValue rest = tree_;
  if (rest.valid() && rest.begin() != rest.end()) refuse(rest.begin()->first, "is unknown");
}

}  // namespace situation_awareness
