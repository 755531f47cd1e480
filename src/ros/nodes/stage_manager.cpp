// SPDX-License-Identifier: BSD-3-Clause
// A nodelet manager that loads stages itself, into its own namespace: when the process ends, one respawn restarts all
// of them. Separate loaders would need 4 s to notice the end of their manager.
//     stage_manager STAGE ... nodelets of this package, each named as its type
#include <algorithm>
#include <csignal>
#include <exception>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <malloc.h>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <nodelet/loader.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>

#include "situation_awareness/ros/master_watch.hpp"

namespace situation_awareness {
namespace {

constexpr double kLookEvery_s = 1.0;
constexpr double kLookForSignal_s = 0.05;

/// Time without input at a new master, after which the process ends. Longer than two periods of MasterWatch, so that
/// every stage has written its parameters.
constexpr double kIdle_s = 5.0;
static_assert(kIdle_s > 2.0 * MasterWatch::kPeriod_s);

/// Loads missing stages periodically: a stage that could not start may do so once its model or parameters are repaired,
/// and an unloaded one is loaded again.
///
/// Registers the stages at a restarted master that does not know them. As long as input arrives over existing
/// connections, the process is not ended: in flight the map is more important than new subscribers. When input has
/// stopped, because its sources were restarted as well, the process ends, and `respawn` (launch/map.launch) starts
/// it at the new master.
class StageManager {
 public:
  explicit StageManager(std::vector<std::string> stages) : stages_(std::move(stages)) {
    for (const std::string& stage : stages_) processed_[ros::names::resolve(stage).substr(1) + ": stage"];
    // They are published in this process: a connection that needs no master.
    diagnostics_ = node_.subscribe("/diagnostics", 100, &StageManager::on_diagnostics, this);
    load_missing();
    timer_ = node_.createSteadyTimer(ros::WallDuration(kLookEvery_s), [this](const ros::SteadyTimerEvent& /*event*/) {
      load_missing();
      end_if_idle_at_new_master();
    });
  }

  /// Ends the stages, while they can still publish: a vehicle keeps the last command that it got. A stage waits
  /// for its callback that runs now.
  void end_stages() {
    timer_.stop();
    loader_.reset();
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
      ROS_FATAL_STREAM(ros::this_node::getName() << ": no input any more and a new master was started: ending, to "
                                                    "be restarted at the new one");
      ros::requestShutdown();
    }
  }

  void load_missing() {
    const std::vector<std::string> loaded = loader_->listLoadedNodelets();
    for (const std::string& stage : stages_) {
      const std::string name = ros::names::resolve(stage);
      if (std::find(loaded.begin(), loaded.end(), name) != loaded.end()) continue;
      try {
        loader_->load(name, "situation_awareness/" + stage, {}, {});
      } catch (const std::exception&) {  // StageNodelet has logged the reason
      }
    }
  }

  std::vector<std::string> stages_;
  std::unique_ptr<nodelet::Loader> loader_ = std::make_unique<nodelet::Loader>();  // with a nodelet manager's services
  ros::NodeHandle node_;
  MasterWatch master_{ros::NodeHandle("~")};
  std::map<std::string, std::string> processed_;  ///< by the stage's name on /diagnostics: its latest count
  ros::SteadyTime last_work_;
  ros::Subscriber diagnostics_;
  ros::SteadyTimer timer_;
};

/// Messages are allocated on one thread and freed on another. By default glibc gives every thread an arena of its own,
/// and each would keep the memory of the largest message that it ever met.
void share_one_arena() { mallopt(M_ARENA_MAX, 1); }

volatile std::sig_atomic_t is_told_to_end = 0;

/// The handler of roscpp shuts the topics down before the stages end, and SIGTERM it does not handle at all. A second
/// signal ends the process at once.
void handle_signals() {
  struct sigaction action = {};
  action.sa_handler = [](int /*signal*/) { is_told_to_end = 1; };
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  situation_awareness::share_one_arena();
  ros::init(argc, argv, "stage_manager", ros::init_options::NoSigintHandler);
  situation_awareness::handle_signals();
  const std::vector<std::string> stages(argv + 1, argv + argc);  // ros::init has removed ROS's arguments
  if (stages.empty()) {
    std::cerr << "usage: stage_manager STAGE ..., such as: stage_manager segmentation detection mapping\n";
    return 2;
  }
  situation_awareness::StageManager manager(stages);
  const ros::WallDuration period(situation_awareness::kLookForSignal_s);
  while (ros::ok() && !situation_awareness::is_told_to_end) ros::getGlobalCallbackQueue()->callAvailable(period);
  if (ros::ok()) manager.end_stages();
  ros::shutdown();  // before the rest of the manager ends, and the loader if it did not, as in the program nodelet
  return 0;
}
