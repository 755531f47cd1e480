// SPDX-License-Identifier: BSD-3-Clause
// A nodelet manager that loads stages itself, into its own namespace: when the process ends, one respawn brings all of
// them back. With loaders of their own they would first have to miss their manager, for 4 s.
//     stage_manager STAGE ...      nodelets of this package, each with the name that it has here
#include <algorithm>
#include <exception>
#include <iostream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <nodelet/loader.h>
#include <ros/ros.h>

#include "situation_awareness/ros/master_watch.hpp"

namespace situation_awareness {
namespace {

constexpr double kLookEvery_s = 1.0;

/// Without work at a new master, after which the process ends. Longer than two periods of MasterWatch: every stage has
/// then given its parameters back.
constexpr double kIdle_s = 5.0;
static_assert(kIdle_s > 2.0 * MasterWatch::kPeriod_s);

/// Loads what is not there, and looks again: a stage that could not start may do so once its model or parameters are
/// repaired, and one that was unloaded begins anew.
///
/// Brings the stages back to a master that was started anew and does not know them. As long as work comes over the
/// links there are, nothing is ended: a flight is worth more than being found. When work has stopped, because what
/// feeds the stages was started anew as well, the process ends, and whatever started it (`respawn` in
/// launch/objects.launch) brings it back at the new master.
class StageManager {
 public:
  explicit StageManager(std::vector<std::string> stages) : stages_(std::move(stages)) {
    for (const std::string& stage : stages_) processed_[ros::names::resolve(stage).substr(1) + ": stage"];
    // They are said in this process: a link that needs no master.
    diagnostics_ = node_.subscribe("/diagnostics", 100, &StageManager::on_diagnostics, this);
    load_missing();
    timer_ = node_.createSteadyTimer(ros::WallDuration(kLookEvery_s), [this](const ros::SteadyTimerEvent& /*event*/) {
      load_missing();
      end_if_idle_at_new_master();
    });
  }

 private:
  void on_diagnostics(const diagnostic_msgs::DiagnosticArray& msg) {
    for (const diagnostic_msgs::DiagnosticStatus& status : msg.status) {
      const auto stage = processed_.find(status.name);
      if (stage == processed_.end()) continue;
      for (const diagnostic_msgs::KeyValue& pair : status.values) {
        if (pair.key != "processed" || pair.value == stage->second) continue;
        stage->second = pair.value;
        last_work_ = ros::SteadyTime::now();
      }
    }
  }

  void end_if_idle_at_new_master() {
    if (!master_.at_new_master()) {
      last_work_ = ros::SteadyTime::now();
    } else if (ros::SteadyTime::now() - last_work_ > ros::WallDuration(kIdle_s)) {
      ROS_FATAL_STREAM(ros::this_node::getName() << ": no work comes any more and a new master was started: ending, to "
                                                    "be started again at the new one");
      ros::requestShutdown();
    }
  }

  void load_missing() {
    const std::vector<std::string> loaded = loader_.listLoadedNodelets();
    for (const std::string& stage : stages_) {
      const std::string name = ros::names::resolve(stage);
      if (std::find(loaded.begin(), loaded.end(), name) != loaded.end()) continue;
      try {
        loader_.load(name, "situation_awareness/" + stage, {}, {});
      } catch (const std::exception&) {  // it has said why itself: StageNodelet
      }
    }
  }

  std::vector<std::string> stages_;
  nodelet::Loader loader_;  // with the services of any manager
  ros::NodeHandle node_;
  MasterWatch master_{ros::NodeHandle("~")};
  std::map<std::string, std::string> processed_;  ///< by the stage's name on /diagnostics: how many, as it last said
  ros::SteadyTime last_work_;
  ros::Subscriber diagnostics_;
  ros::SteadyTimer timer_;
};

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  ros::init(argc, argv, "stage_manager");
  const std::vector<std::string> stages(argv + 1, argv + argc);  // ros::init has taken what is ROS's
  if (stages.empty()) {
    std::cerr << "usage: stage_manager STAGE ..., such as: stage_manager segmentation detection mapping\n";
    return 2;
  }
  situation_awareness::StageManager manager(stages);
  ros::spin();
  ros::shutdown();  // before the loader ends, as in the program nodelet
  return 0;
}
