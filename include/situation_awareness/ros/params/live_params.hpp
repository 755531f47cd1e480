// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <dynamic_reconfigure/Config.h>
#include <dynamic_reconfigure/server.h>
#include <ros/console.h>
#include <ros/node_handle.h>
#include <ros/timer.h>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/scan/range_limiter.hpp"

namespace situation_awareness {

/// A visitor for the `fields()` of params structs: gives each field that `msg` names the value it has there.
class ReadConfig {
 public:
  explicit ReadConfig(const dynamic_reconfigure::Config& msg) : msg_(msg) {}

  void operator()(const char* name, double& value, Bounds bounds, const char* unit, const char* doc) const;
  void operator()(const char* name, int& value, Bounds bounds, const char* unit, const char* doc) const;
  void operator()(const char* name, std::vector<HalfSpace>& value, const char* doc) const;  ///< from YAML text
  void operator()(const char* /*name*/, const std::string& /*value*/, const char* /*doc*/) const {}
  template <class Section>
  void operator()(const char* /*name*/, const Section& /*section*/) const {}  ///< has its own place in Params

 private:
  const dynamic_reconfigure::Config& msg_;
};

/// The other way round: sets what `msg` names already.
class WriteConfig {
 public:
  explicit WriteConfig(dynamic_reconfigure::Config& msg) : msg_(msg) {}

  void operator()(const char* name, double value, Bounds bounds, const char* unit, const char* doc) const;
  void operator()(const char* name, int value, Bounds bounds, const char* unit, const char* doc) const;
  void operator()(const char* name, const std::vector<HalfSpace>& value, const char* doc) const;
  void operator()(const char* /*name*/, const std::string& /*value*/, const char* /*doc*/) const {}
  template <class Section>
  void operator()(const char* /*name*/, const Section& /*section*/) const {}  ///< has its own place in Params

 private:
  dynamic_reconfigure::Config& msg_;
};

/// Every value: "a = 1, b = 2".
std::string config_text(const dynamic_reconfigure::Config& msg);

/// What differs: "a = 1 (BEFORE_WORD 3), ..."; empty if nothing does.
std::string config_changes(const dynamic_reconfigure::Config& before, const dynamic_reconfigure::Config& after,
                           const std::string& before_word);

/// What can be changed of `Params...` while a nodelet runs: a dynamic_reconfigure server of the generated type `Config`
/// in the namespace `live` of the nodelet. Its parameters are the fields of the structs that have the same names.
///
/// It starts with what that namespace holds, else with what YAML says: live values survive a respawn and, by
/// clear_params, not a launch. A change is used only if every struct's validate() lets it pass; else the old values
/// stay and go back to who asked. Lives on the callback queue of its node handle, so it needs no lock.
template <class Config, class... Params>
class LiveParams {
 public:
  /// Takes what is valid from now on.
  using Use = std::function<void(const Params&...)>;

  /// `yaml`: the parameters as YAML says. Calls `use` at once.
  LiveParams(const ros::NodeHandle& private_node, const std::string& name, const Params&... yaml, Use use)
      : node_(private_node, "live"), name_(name), params_(yaml...), use_(std::move(use)), config_(config_of(params_)) {
    const dynamic_reconfigure::Config said = message_of(config_);
    Config kept = config_;
    kept.__fromServer__(node_);  // leaves alone what is not there
    kept.__clamp__();
    try {
      take(kept);
    } catch (const std::exception& error) {
      ROS_WARN_STREAM(name_ << ": what " << node_.getNamespace() << " holds is not used: " << error.what());
      std::apply(use_, params_);
    }
    config_.__toServer__(node_);
    const dynamic_reconfigure::Config start = message_of(config_);
    ROS_INFO_STREAM(name_ << ": live parameters: " << config_text(start));
    const std::string others = config_changes(said, start, "YAML:");
    if (!others.empty()) ROS_INFO_STREAM(name_ << ": changed live before: " << others);
    // Not at once: while a nodelet is made its callback queue takes nothing in, and whoever calls a service of it then
    // waits for ever.
    start_ = node_.createWallTimer(ros::WallDuration(0.01), [this](const ros::WallTimerEvent&) { serve(); });
  }

 private:
  static dynamic_reconfigure::Config message_of(const Config& config) {
    dynamic_reconfigure::Config msg;
    config.__toMessage__(msg);
    return msg;
  }

  static Config config_of(const std::tuple<Params...>& params) {
    Config config = Config::__getDefault__();
    dynamic_reconfigure::Config msg = message_of(config);
    std::apply([&msg](const Params&... each) { (Params::fields(each, WriteConfig(msg)), ...); }, params);
    config.__fromMessage__(msg);
    return config;
  }

  void serve() {
    start_.stop();
    try {
      server_ = std::make_unique<dynamic_reconfigure::Server<Config>>(node_);
      server_->setCallback([this](Config& config, std::uint32_t /*level*/) { change(config); });
    } catch (const std::exception& error) {
      ROS_ERROR_STREAM(name_ << ": no live parameters: " << error.what());
    }
  }

  void change(Config& config) {
    const dynamic_reconfigure::Config before = message_of(config_);
    try {
      take(config);
      const std::string changes = config_changes(before, message_of(config_), "was");
      if (!changes.empty()) ROS_INFO_STREAM(name_ << ": " << changes);
    } catch (const std::exception& error) {
      ROS_WARN_STREAM(name_ << ": live change refused, the old values stay: " << error.what());
    }
    config = config_;
  }

  /// Throws what the structs' validate() or `use` throws; nothing has changed then.
  void take(const Config& config) {
    const dynamic_reconfigure::Config msg = message_of(config);
    std::tuple<Params...> next = params_;
    std::apply(
        [&](Params&... each) {
          (Params::fields(each, ReadConfig(msg)), ...);
          (each.validate(), ...);
          use_(each...);
        },
        next);
    params_ = next;
    config_ = config_of(next);
  }

  ros::NodeHandle node_;
  std::string name_;
  std::tuple<Params...> params_;
  Use use_;
  Config config_;
  std::unique_ptr<dynamic_reconfigure::Server<Config>> server_;
  ros::WallTimer start_;
};

}  // namespace situation_awareness
