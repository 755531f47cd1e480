// SPDX-License-Identifier: BSD-3-Clause
// One page about a recorded bag, before anything is mapped.
#include <cstdio>
#include <string>
#include <vector>

#include "command_line.hpp"
#include "situation_awareness/ros/bag/images.hpp"
#include "situation_awareness/ros/check/recording_check.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kName = "check_bag";
constexpr const char* kDescription =
    R"(Reads a bag and prints one page: the topics of which a map can be made with their rates, stamps, frames and what is
unusual about them, the transforms, what contradicts each other with its remedy, and the lines that map it: map_bag for
the bag, map.launch for the same sensors live. The exit code is 1 if the bag cannot be mapped.
)";

struct Options {
  std::vector<std::string> bags;
  ElevationParams elevation;
  bool is_live = false;
};

void add_options(CommandLine& app, Options& options) {
  app.add_option("IN.bag", options.bags, "the bag; all of them, if the recording was split").required().type_name("");
  add_dem_options(app, options.elevation);
  app.add_option("--origin", options.elevation.origin, "of the world: latitude, longitude (deg), altitude (m)")
      .type_name("LAT,LON,ALT");
  app.add_flag("--live", options.is_live, "the bag was made for this page: print the line of map.launch alone");
}

int check_bag(const Options& options) {
  const RecordingCheck check(options.bags, options.elevation);
  for (const TopicReport& topic : check.topics()) {
    std::printf("%s  %s\n", topic.topic.c_str(), topic.type.c_str());
    for (const std::string& fact : topic.facts) std::printf("    %s\n", fact.c_str());
  }
  for (const std::string& fact : check.facts()) std::printf("%s\n", fact.c_str());
  int number = 0;
  const auto print = [&number](const std::string& topic, const Finding& finding) {
    std::printf("%s%2d. %s%s%s\n    -> %s\n", number == 0 ? "\nTo look at\n" : "", number + 1, topic.c_str(),
                topic.empty() ? "" : ": ", finding.what.c_str(), finding.remedy.c_str());
    ++number;
  };
  for (const TopicReport& topic : check.topics()) {
    for (const Finding& finding : topic.findings) print(topic.topic, finding);
  }
  for (const Finding& finding : check.findings()) print("", finding);
  if (!check.plan().is_possible()) {
    std::printf("\nIt cannot be mapped.\n");
    return 1;
  }
  if (!options.is_live) std::printf("\nMap it\n    %s\n", map_bag_line(check.plan(), options.bags).c_str());
  std::printf("\nLive\n    %s\n", map_launch_line(check.plan()).c_str());
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  return run_program<Options>(kName, kDescription, argc, argv, add_options, check_bag);
}
