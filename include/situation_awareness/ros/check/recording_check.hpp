// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "situation_awareness/pipeline/scanner_check.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/check/report.hpp"
#include "situation_awareness/ros/check/topic_check.hpp"
#include "situation_awareness/ros/check/transform_tree.hpp"
#include "situation_awareness/ros/params/elevation_params.hpp"

namespace situation_awareness {

/// How a recording is mapped.
struct MapPlan {
  enum class Pose { kNone, kTf, kGps, kStaticSensor };

  Pose pose = Pose::kNone;
  std::string scan_topic;                        ///< empty: no scans
  std::string cloud_topic;                       ///< in place of scans
  std::string sensor_frame;                      ///< of the scans or clouds, or of the images where there are none
  std::string world_frame, tf_topic = "/tf";     ///< with kTf
  std::string base_frame, imu_topic, fix_topic;  ///< with kGps
  std::string image_topic, camera_info_topic;    ///< empty: no images
  bool are_labels = false;                       ///< the images are labels
  ElevationParams elevation;                     ///< under the images

  bool has_scans() const { return !scan_topic.empty() || !cloud_topic.empty(); }
  bool has_images() const { return !image_topic.empty() && !elevation.dem.empty(); }
  bool is_possible() const { return pose != Pose::kNone && (has_scans() || (has_images() && pose == Pose::kTf)); }
};

/// "rosrun situation_awareness map_bag ...", with which the recording is mapped without another argument.
std::string map_bag_line(const MapPlan& plan, const std::vector<std::string>& bags);
/// "roslaunch situation_awareness map.launch ...", for the same sensors live.
std::string map_launch_line(const MapPlan& plan);

/// What a recording has for a map, looked at before anything is mapped: its topics, its transforms, how they fit to
/// each other, and how it is mapped.
class RecordingCheck {
 public:
  /// Reads the recording, which may be split into several bags. Throws as Recording.
  RecordingCheck(std::vector<std::string> bags, const ElevationParams& elevation);

  /// The topics of which a map can be made, and the transforms.
  const std::vector<TopicReport>& topics() const { return topics_; }
  /// What none of the topics tells alone.
  const std::vector<Finding>& findings() const { return findings_; }
  const MapPlan& plan() const { return plan_; }
  /// What poses say of the motion, and where the elevation is.
  const std::vector<std::string>& facts() const { return facts_; }

 private:
  void read();
  void choose();
  void choose_sensor();
  void choose_images();
  void look_at_elevation();
  void choose_pose();
  void choose_gps();
  void look_at_odometry();
  void compare_clocks();
  BagOptions bag_options() const;
  void follow_scans();
  void follow_clouds();
  void follow_images();
  void follow_gps();
  void advise(const ScannerCheck& scanner);
  const TopicCheck& check_of(const std::string& topic) const;
  std::string known_frame(const std::string& topic) const;
  template <class Check>
  std::vector<const Check*> checks_of() const;

  std::vector<std::string> bags_;
  std::vector<std::unique_ptr<TopicCheck>> checks_;
  TransformTree transforms_;
  std::vector<TopicReport> topics_;
  std::vector<Finding> findings_;
  std::vector<std::string> facts_;
  MapPlan plan_;
  std::size_t images_ = 0;  ///< on the plan's topic
};

}  // namespace situation_awareness
