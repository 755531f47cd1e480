// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>

#include <xmlrpcpp/XmlRpcValue.h>

#include "situation_awareness/common/params_yaml.hpp"

namespace ros {
class NodeHandle;
}

namespace situation_awareness {

/// A value of the parameter server as YAML text, in the flow style.
std::string yaml_from_xmlrpc(XmlRpc::XmlRpcValue value);

/// The parameters of a node on the parameter server. Its parameter `config_yaml`, if there is one, is the text of the
/// file that they are from: what the file has in a way that the parameter server cannot tell, a key that is given
/// twice, is refused as the offline tools do.
class ParamReader {
 public:
  /// Takes a copy of the private namespace.
  explicit ParamReader(const ros::NodeHandle& private_node);

  /// `source` begins each message; `tree` is a struct, or invalid for no parameters.
  ParamReader(const XmlRpc::XmlRpcValue& tree, const std::string& source);

  /// A params struct, as params_from_yaml does.
  template <class Params>
  Params read(const OnUnknownKey& on_unknown_key, Params defaults = Params()) const {
    if (!file_yaml_.empty()) {
      Params of_file = defaults;
      read_yaml(parameters_of(of_file), file_yaml_, source_, [](const UnknownKey& /*key*/) {});
    }
    return params_from_yaml<Params>(yaml_, source_, on_unknown_key, std::move(defaults));
  }

  const std::string& source() const { return source_; }

 private:
  std::string yaml_, file_yaml_;
  std::string source_;
};

}  // namespace situation_awareness
