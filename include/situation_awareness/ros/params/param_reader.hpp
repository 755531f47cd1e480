// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <xmlrpcpp/XmlRpcValue.h>

#include "situation_awareness/common/params.hpp"

namespace ros {
class NodeHandle;
}

namespace situation_awareness {

/// A value of the parameter server as YAML text, in the flow style.
std::string yaml_from_xmlrpc(XmlRpc::XmlRpcValue value);

/// Takes the parameters of a node one by one; what nobody has taken is unknown. Every function throws
/// std::invalid_argument with one sentence that names the node, the parameter and what is wrong with it.
class ParamReader {
 public:
  /// Reads the private namespace once.
  explicit ParamReader(const ros::NodeHandle& private_node);

  /// `source` begins each sentence; `tree` is a struct, or invalid for no parameters.
  ParamReader(const XmlRpc::XmlRpcValue& tree, const std::string& source);

  double take_number(const std::string& name, double otherwise, Bounds bounds, const std::string& unit);
  int take_integer(const std::string& name, int otherwise, Bounds bounds, const std::string& unit);
  bool take_flag(const std::string& name, bool otherwise);
  std::string take_text(const std::string& name, const std::string& otherwise);

  /// Leaves out what others read.
  void skip(const std::string& name);

  /// What has not been taken, as YAML text.
  std::string rest_as_yaml() const;

  /// Refuses what has not been taken.
  void refuse_rest() const;

  /// The names that were asked for.
  const std::vector<std::string>& known() const { return known_; }

  const std::string& source() const { return source_; }

 private:
  XmlRpc::XmlRpcValue take(const std::string& name);
  [[noreturn]] void refuse(const std::string& name, const std::string& defect) const;

  XmlRpc::XmlRpcValue tree_;
  std::string source_;
  std::vector<std::string> known_;
};

}  // namespace situation_awareness
