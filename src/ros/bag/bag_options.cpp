// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/bag_options.hpp"

#include "command_line.hpp"
#include "situation_awareness/ros/params/package.hpp"

namespace situation_awareness {

void add_bag_options(CommandLine& app, BagOptions& options, const std::string& default_config) {
  app.add_option("IN.bag", options.bags, "the bag; all of them, if the recording was split")
      .required()
      .type_name("")
      .default_str("")
      .take_all();
  app.add_option("--world-frame", options.world_frame, "frame of the map, found among the transforms")
      .type_name("NAME");
  app.add_option("--tf-topic", options.tf_topic,
                 "tf2_msgs/TFMessage, such as /robot1/tf; static transforms\nare on TOPIC_static")
      .type_name("TOPIC");
  app.add_flag("--static-sensor", options.static_sensor, "the sensor is the world: for bags without transforms");
  app.add_option("--tf-timeout", options.tf_timeout_s,
                 "how long a measurement waits for its transforms, by the\ntime of the recording")
      .type_name("S")
      .check(from_to(0.0, 1e6));
  app.add_option("--config", options.config, "parameters (default: cfg/" + default_config + " of this package)")
      .type_name("FILE");
}

std::string config_path(const BagOptions& options, const std::string& default_config) {
  return options.config.empty() ? package_folder() + "/cfg/" + default_config : options.config;
}

}  // namespace situation_awareness
