// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <exception>
#include <string>
#include <vector>

#include <ros/console.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <boost/function.hpp>

#include "situation_awareness/ros/stage_context.hpp"

namespace situation_awareness {

/// Services of a stage whose responses have the members `success` and `message`. `context` must outlive it.
class Services {
 public:
  explicit Services(const StageContextBase& context) : context_(context) {}

  /// Advertises a service that responds with what `act(request, response)` sets, or with the reason of its exception;
  /// nothing escapes.
  template <class Service, class Act>
  void add(ros::NodeHandle& node, const std::string& name, Act act) {
    using Request = typename Service::Request;
    using Response = typename Service::Response;
    const boost::function<bool(Request&, Response&)> answer = [this, act](Request& request, Response& response) {
      try {
        act(request, response);
        response.success = true;
        if (!response.message.empty()) ROS_INFO_STREAM(context_.name() << ": " << response.message);
      } catch (const std::exception& error) {
        response = {};
        response.message = error.what();
        ROS_WARN_STREAM(context_.name() << ": refused: " << response.message);
      }
      return true;
    };
    servers_.push_back(node.advertiseService<Request, Response>(name, answer));
  }

 private:
  const StageContextBase& context_;
  std::vector<ros::ServiceServer> servers_;
};

/// "1 feature", "2 features".
std::string count_of(std::size_t number, const std::string& of_what);

/// Throws std::invalid_argument if it is no absolute path.
void check_absolute(const std::string& file);

}  // namespace situation_awareness
