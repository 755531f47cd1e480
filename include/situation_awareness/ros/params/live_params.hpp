// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <dynamic_reconfigure/Config.h>
#include <dynamic_reconfigure/ConfigDescription.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_server.h>

#include "situation_awareness/common/params.hpp"

namespace situation_awareness {

/// The live ones of the parameters, in the same order. Throws std::logic_error if two of them have the same name:
/// dynamic_reconfigure knows no sections.
std::vector<Parameter> live_parameters(const std::vector<Parameter>& parameters);

/// Their values as a message of dynamic_reconfigure; user-defined types are strings with YAML text.
dynamic_reconfigure::Config config_of(const std::vector<Parameter>& parameters);

/// Their description for dynamic_reconfigure: types, bounds, their values as defaults, "SENTENCE [UNIT]".
dynamic_reconfigure::ConfigDescription description_of(const std::vector<Parameter>& parameters);

/// Set the parameters in `config`, numbers beyond a bound to the bound. Returns the names of unknown ones and of those
/// of another type. Throws std::invalid_argument naming a parameter whose text cannot be read.
std::vector<std::string> set_from_config(const std::vector<Parameter>& parameters,
                                         const dynamic_reconfigure::Config& config);

/// A server of dynamic_reconfigure for the parameters declared as live, without a .cfg file (docs/ros.md, "Live
/// parameters").
///
/// It starts with the values in its namespace on the parameter server, else with the given ones: live values survive a
/// respawn and, by clear_params, not a launch. A change that `use` refuses is undone, and the old values are returned
/// to the client. All calls are on the callback queue of its node handle, without a lock.
class LiveParamsServer {
 public:
  /// `parameters`: references to the values from YAML; `defaults`: the same parameters at their defaults. `use` is
  /// called at once and after each change; it throws to refuse the change.
  LiveParamsServer(const ros::NodeHandle& node, const std::string& name, const std::vector<Parameter>& parameters,
                   const std::vector<Parameter>& defaults, std::function<void()> use);

  /// Accepts changes from now on. Not during construction of the nodelet: its callback queue may not be served yet, and
  /// callers would wait for ever.
  void serve();

 private:
  dynamic_reconfigure::Config from_parameter_server() const;
  void to_parameter_server() const;
  bool change(dynamic_reconfigure::ReconfigureRequest& request, dynamic_reconfigure::ReconfigureResponse& response);

  ros::NodeHandle node_;
  std::string name_;
  std::vector<Parameter> parameters_;
  dynamic_reconfigure::ConfigDescription description_;
  std::function<void()> use_;
  ros::Publisher descriptions_, updates_;
  ros::ServiceServer service_;
};

/// The live parameters of `Params...`: a server in the namespace `live` of the nodelet. A change is used only if every
/// struct's validate() accepts it.
template <class... Params>
class LiveParams {
 public:
  /// Gets the valid values; may throw to refuse them.
  using Use = std::function<void(const Params&...)>;

  /// `start`: the parameters from YAML. Calls `use` at once.
  LiveParams(const ros::NodeHandle& private_node, const std::string& name, const Params&... start, Use use)
      : params_(start...),
        use_(std::move(use)),
        server_(ros::NodeHandle(private_node, "live"), name, list(params_), list(defaults_), [this] { use_valid(); }) {}
  LiveParams(const LiveParams&) = delete;
  LiveParams& operator=(const LiveParams&) = delete;

  /// Accepts changes from now on: LiveParamsServer::serve().
  void serve() { server_.serve(); }

 private:
  static std::vector<Parameter> list(std::tuple<Params...>& params) {
    std::vector<Parameter> all;
    const auto add = [&all](auto& each) {
      for (Parameter& parameter : parameters_of(each)) all.push_back(std::move(parameter));
    };
    std::apply([&add](Params&... each) { (add(each), ...); }, params);
    return live_parameters(all);
  }

  void use_valid() const {
    std::apply(
        [this](const Params&... each) {
          (each.validate(), ...);
          use_(each...);
        },
        params_);
  }

  std::tuple<Params...> params_;
  std::tuple<Params...> defaults_;
  Use use_;
  LiveParamsServer server_;
};

}  // namespace situation_awareness
