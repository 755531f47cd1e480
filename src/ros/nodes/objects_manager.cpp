// SPDX-License-Identifier: BSD-3-Clause
// A nodelet manager that loads the three stages itself, into its own namespace: when the process ends, one respawn
// brings all of them back. With loaders of their own they would first have to miss their manager, for 4 s.
#include <algorithm>
#include <exception>
#include <string>
#include <vector>

#include <nodelet/loader.h>
#include <ros/ros.h>

namespace situation_awareness {
namespace {

constexpr double kLookEvery_s = 1.0;

/// Loads what is not there, and looks again: a stage that could not start may do so once its model or parameters are
/// repaired, and one that was unloaded begins anew.
class ObjectsManager {
 public:
  ObjectsManager() {
    load_missing();
    timer_ = node_.createWallTimer(ros::WallDuration(kLookEvery_s),
                                   [this](const ros::WallTimerEvent& /*event*/) { load_missing(); });
  }

 private:
  void load_missing() {
    const std::vector<std::string> loaded = loader_.listLoadedNodelets();
    for (const char* stage : {"segmentation", "detection", "mapping"}) {
      const std::string name = ros::names::resolve(stage);
      if (std::find(loaded.begin(), loaded.end(), name) != loaded.end()) continue;
      try {
        loader_.load(name, std::string("situation_awareness/") + stage, {}, {});
      } catch (const std::exception&) {  // it has said why itself: StageNodelet
      }
    }
  }

  nodelet::Loader loader_;  // with the services of any manager
  ros::NodeHandle node_;
  ros::WallTimer timer_;
};

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  ros::init(argc, argv, "objects_manager");
  situation_awareness::ObjectsManager manager;
  ros::spin();
  ros::shutdown();  // before the loader ends, as in the program nodelet
  return 0;
}
