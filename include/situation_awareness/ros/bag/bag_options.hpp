// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace situation_awareness {

class CommandLine;

/// Common options of all programs that read a bag.
struct BagOptions {
  std::vector<std::string> bags;  ///< of one recording: several if it was split
  std::string config;             ///< path; empty: cfg/ of this package
  std::string world_frame = "world";
  std::string tf_topic = "/tf";  ///< static transforms are on TOPIC_static
  bool static_sensor = false;
  double tf_timeout_s = 10.0;
};

/// Adds the options for the bag, its frames and parameters. `default_config` is the name of a file in cfg/.
void add_bag_options(CommandLine& app, BagOptions& options, const std::string& default_config);

/// The file of parameters. Throws std::runtime_error where the package is not found.
std::string config_path(const BagOptions& options, const std::string& default_config);

}  // namespace situation_awareness
