// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/check/recording_check.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include <rosbag/message_instance.h>

#include "situation_awareness/common/format.hpp"
#include "situation_awareness/map/grid/elevation_file.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/bag/images.hpp"
#include "situation_awareness/ros/bag/recording.hpp"
#include "situation_awareness/ros/bag/scans.hpp"
#include "situation_awareness/ros/check/camera.hpp"
#include "situation_awareness/ros/check/motion.hpp"
#include "situation_awareness/ros/check/scanner_motion.hpp"
#include "situation_awareness/ros/check/scans.hpp"
#include "situation_awareness/ros/convert/camera.hpp"
#include "situation_awareness/ros/convert/compressed_image.hpp"
#include "situation_awareness/ros/gps_ins_input.hpp"
#include "situation_awareness/ros/pose_offset_report.hpp"

namespace situation_awareness {
namespace {

/// Clocks of two topics that differ by more than this are not the same.
constexpr double kClocks_s = 0.5;
/// An IMU stands upright if so much of gravity is along its z.
constexpr double kUpright = 0.9;
/// Images that are mapped, at most: each takes a network some 30 ms, and heights are told by 16
/// (pipeline/ground_in_view).
constexpr std::size_t kImages = 64;

/// An argument as a shell takes it.
std::string quoted(const std::string& text) {
  const bool is_plain = text.find_first_of(" '\"\\$&|;<>()*?[]!`~#") == std::string::npos;
  return is_plain && !text.empty() ? text : "'" + text + "'";
}

/// Plays the recording to its end; returns why nothing of it was mapped, or nothing.
std::string why_nothing_mapped(BagPlayer& player) {
  player.play();
  try {
    player.check_mapped();
    return "";
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

}  // namespace

std::string map_bag_line(const MapPlan& plan, const std::vector<std::string>& bags) {
  std::string line = "rosrun situation_awareness map_bag";
  for (const std::string& bag : bags) line += " " + quoted(bag);
  const auto add = [&line](const std::string& option, const std::string& value) {
    line += " " + option + " " + quoted(value);
  };
  if (!plan.scan_topic.empty()) add("--scan-topic", plan.scan_topic);
  if (!plan.cloud_topic.empty()) add("--cloud-topic", plan.cloud_topic);
  switch (plan.pose) {
    case MapPlan::Pose::kTf:
      if (plan.tf_topic != "/tf") add("--tf-topic", plan.tf_topic);
      add("--world-frame", plan.world_frame);
      break;
    case MapPlan::Pose::kGps:
      line += " --pose gps";
      add("--imu-topic", plan.imu_topic);
      add("--fix-topic", plan.fix_topic);
      add("--base-frame", plan.base_frame);
      break;
    case MapPlan::Pose::kStaticSensor:
      line += " --static-sensor";
      break;
    case MapPlan::Pose::kNone:
      break;
  }
  if (plan.has_images() && plan.pose == MapPlan::Pose::kTf) {
    add("--kinds", plan.has_scans() ? "objects,polygons,splinegons,grid" : "grid");
    add(plan.are_labels ? "--labels-topic" : "--image-topic", plan.image_topic);
    add("--camera-info-topic", plan.camera_info_topic);
    add("--dem", plan.elevation.dem);
    if (!plan.elevation.origin.empty()) add("--origin", plan.elevation.origin);
    if (!plan.elevation.dem_vertical.empty()) add("--dem-vertical", plan.elevation.dem_vertical);
    if (plan.elevation.dem_geoid_m != 0.0) add("--dem-geoid-m", formatted("%g", plan.elevation.dem_geoid_m));
  }
  return line + " --out map.jsonl";
}

std::string map_launch_line(const MapPlan& plan) {
  std::string line = "roslaunch situation_awareness map.launch";
  const auto add = [&line](const std::string& name, const std::string& value) {
    line += " " + quoted(name + ":=" + value);
  };
  if (!plan.scan_topic.empty()) add("scan", plan.scan_topic);
  if (!plan.cloud_topic.empty()) add("cloud", plan.cloud_topic);
  if (!plan.has_scans()) add("kinds", "grid");
  switch (plan.pose) {
    case MapPlan::Pose::kTf:
      add("world_frame", plan.world_frame);
      break;
    case MapPlan::Pose::kGps:
      add("imu", plan.imu_topic);
      add("fix", plan.fix_topic);
      add("base_frame", plan.base_frame);
      break;
    case MapPlan::Pose::kStaticSensor:
      add("static_sensor", "true");
      add("lidar_frame", plan.sensor_frame);
      break;
    case MapPlan::Pose::kNone:
      break;
  }
  if (plan.has_images() && plan.pose == MapPlan::Pose::kTf) {
    add(plan.are_labels ? "labels" : "image", plan.image_topic);
    add("camera_info", plan.camera_info_topic);
    add("dem", std::filesystem::absolute(plan.elevation.dem).string());
    if (!plan.elevation.origin.empty()) add("origin", plan.elevation.origin);
  }
  return line;
}

RecordingCheck::RecordingCheck(std::vector<std::string> bags, const ElevationParams& elevation)
    : bags_(std::move(bags)) {
  plan_.elevation = elevation;
  read();
  choose();
  for (const auto& check : checks_) topics_.push_back(check->report());
  TopicReport transforms;
  transforms.topic = plan_.tf_topic;
  transforms.type = "transforms";
  transforms_.report(transforms);
  if (!transforms_.empty()) topics_.push_back(std::move(transforms));
  compare_clocks();
  if (plan_.pose == MapPlan::Pose::kGps) {
    follow_gps();
  } else if (plan_.is_possible() && plan_.has_scans()) {
    plan_.scan_topic.empty() ? follow_clouds() : follow_scans();
  }
  if (plan_.has_images() && plan_.pose == MapPlan::Pose::kTf) follow_images();
}

void RecordingCheck::read() {
  const Recording recording(bags_);
  const std::set<std::string> tf_topics = recording.transform_topics();
  if (!tf_topics.empty() && tf_topics.count("/tf") == 0) plan_.tf_topic = *tf_topics.begin();
  const std::string tf = tf2_frame(plan_.tf_topic), tf_static = static_topic_of(tf);
  std::map<std::string, TopicCheck*> by_topic;
  std::vector<std::string> topics = {tf, "/" + tf, tf_static, "/" + tf_static};
  for (const auto& [topic, datatype] : recording.topics()) {
    if (by_topic.count(topic) > 0) continue;
    std::unique_ptr<TopicCheck> check = make_topic_check(topic, datatype);
    if (!check) continue;
    by_topic[topic] = check.get();
    topics.push_back(topic);
    checks_.push_back(std::move(check));
  }
  recording.read(topics, [&](const rosbag::MessageInstance& instance) {
    const auto check = by_topic.find(instance.getTopic());
    if (check != by_topic.end()) {
      check->second->add(instance);
    } else if (const auto msg = instance.instantiate<tf2_msgs::TFMessage>()) {
      transforms_.add(*msg, tf2_frame(instance.getTopic()) == tf_static, to_nanoseconds(instance.getTime()));
    }
    return true;
  });
}

template <class Check>
std::vector<const Check*> RecordingCheck::checks_of() const {
  std::vector<const Check*> found;
  for (const auto& check : checks_) {
    const auto* const of_type = dynamic_cast<const Check*>(check.get());
    if (of_type != nullptr && of_type->stamps().count() > 0) found.push_back(of_type);
  }
  return found;
}

void RecordingCheck::choose() {
  choose_sensor();
  choose_images();
  if (plan_.sensor_frame.empty() && plan_.image_topic.empty()) {
    findings_.push_back({"there are neither scans nor clouds of which a map can be made",
                         "record a sensor_msgs/LaserScan or a sensor_msgs/PointCloud2"});
  }
  choose_pose();
  look_at_odometry();
}

void RecordingCheck::choose_sensor() {
  const auto by_good = [](const auto* a, const auto* b) { return a->good() < b->good(); };
  const auto scans = checks_of<ScanTopicCheck>();
  const auto clouds = checks_of<CloudTopicCheck>();
  const auto scan = std::max_element(scans.begin(), scans.end(), by_good);
  const auto cloud = std::max_element(clouds.begin(), clouds.end(), by_good);
  if (scan != scans.end() && (*scan)->good() > 0) {
    plan_.scan_topic = (*scan)->topic();
    plan_.sensor_frame = (*scan)->frame();
  } else if (cloud != clouds.end() && (*cloud)->good() > 0) {
    plan_.cloud_topic = (*cloud)->topic();
    plan_.sensor_frame = (*cloud)->frame();
  }
}

void RecordingCheck::choose_pose() {
  const auto odometry = checks_of<OdometryTopicCheck>();
  plan_.world_frame = transforms_.world_of(plan_.sensor_frame);
  if (!plan_.world_frame.empty() && !plan_.sensor_frame.empty()) {
    plan_.pose = MapPlan::Pose::kTf;
    if (plan_.tf_topic != "/tf") {
      findings_.push_back(
          {"the transforms are on " + plan_.tf_topic,
           "live, start with this topic and " + static_topic_of(plan_.tf_topic) + " remapped from /tf and /tf_static"});
    }
    return;
  }
  if (!checks_of<ImuTopicCheck>().empty() && !checks_of<FixTopicCheck>().empty()) {
    choose_gps();
    return;
  }
  if (!plan_.has_scans()) return;
  if (transforms_.empty()) {
    plan_.pose = MapPlan::Pose::kStaticSensor;
    findings_.push_back({"there are no transforms: nothing says where the sensor is",
                         "if it stands still, the line below maps it; else record /tf and /tf_static, too"});
    return;
  }
  const std::string root = transforms_.chain(plan_.sensor_frame).back();
  std::string what = transforms_.has(plan_.sensor_frame)
                         ? "no transform says where " + root + " is in a frame that stands still, such as odom"
                         : "no transform leads to " + plan_.sensor_frame + ", the frame of " +
                               (plan_.scan_topic.empty() ? plan_.cloud_topic : plan_.scan_topic);
  std::string remedy = transforms_.has(plan_.sensor_frame)
                           ? "let odometry publish its transform, and record /tf"
                           : "publish it: rosrun tf2_ros static_transform_publisher X Y Z YAW PITCH ROLL BASE " +
                                 plan_.sensor_frame + ", and record /tf_static";
  if (!odometry.empty()) remedy += " (" + odometry.front()->topic() + " has the poses)";
  findings_.push_back({std::move(what), std::move(remedy)});
}

void RecordingCheck::choose_gps() {
  const ImuTopicCheck* const imu = checks_of<ImuTopicCheck>().front();
  plan_.pose = MapPlan::Pose::kGps;
  plan_.imu_topic = imu->topic();
  plan_.fix_topic = checks_of<FixTopicCheck>().front()->topic();
  const std::string of = plan_.sensor_frame.empty() ? imu->frame() : plan_.sensor_frame;
  plan_.base_frame = transforms_.has("base_link") ? "base_link" : transforms_.chain(of).back();
  for (const std::string& topic : {plan_.imu_topic, plan_.fix_topic}) {
    const std::string& frame = check_of(topic).frame();
    if (known_frame(topic) == frame) continue;
    findings_.push_back({"no transform says where " + (frame.empty() ? "the sensor" : frame) + " of " + topic +
                             " is on " + plan_.base_frame + ": it is taken to be there, with its axes",
                         "publish it if it is not: rosrun tf2_ros static_transform_publisher"});
  }
  const Eigen::Vector3d force = imu->mean_force_m_s2();
  if (known_frame(plan_.imu_topic) != imu->frame() && force.z() < kUpright * force.norm()) {
    findings_.push_back(
        {plan_.imu_topic + formatted(" does not stand upright: gravity is along its (%.2f, %.2f, %.2f)",
                                     force.x() / force.norm(), force.y() / force.norm(), force.z() / force.norm()),
         "publish its place on " + plan_.base_frame + " with its rotation"});
  }
}

/// Odometry is of use for a pose by reflectors, and where TF has its base.
void RecordingCheck::look_at_odometry() {
  for (const OdometryTopicCheck* odometry : checks_of<OdometryTopicCheck>()) {
    const std::string& base = odometry->child_frame();
    if (base.empty() || transforms_.empty() || transforms_.has(base)) continue;
    findings_.push_back({"no transform leads to " + base + ", the child frame of " + odometry->topic(),
                         "--base-frame names the base that TF has"});
  }
}

void RecordingCheck::choose_images() {
  for (const auto& check : checks_) {
    const auto* const images = dynamic_cast<const ImageFormat*>(check.get());
    if (images == nullptr || !images->first()) continue;
    const CameraInfoTopicCheck* camera = nullptr;
    for (const CameraInfoTopicCheck* info : checks_of<CameraInfoTopicCheck>()) {
      if (camera == nullptr && info->first() && is_size_of(*info->first(), *images->first())) camera = info;
    }
    if (camera == nullptr) {
      findings_.push_back({check->topic() + " has no sensor_msgs/CameraInfo of its size",
                           "record the camera_info of the camera beside its images"});
      continue;
    }
    const std::string topic = without_transport(check->topic());
    const CameraModel model = camera_model(*camera->first(), *images->first(), image_kind("auto", topic));
    if (!model.defect.empty()) findings_.push_back({camera->topic() + ": " + model.defect, "docs/ros.md"});
    if (!model.assumed.empty()) findings_.push_back({check->topic() + ": " + model.assumed, "docs/ros.md"});
    if (!plan_.image_topic.empty() && (plan_.are_labels || !images->are_labels())) continue;
    plan_.image_topic = topic;
    plan_.camera_info_topic = camera->topic();
    images_ = check->stamps().count();
    plan_.are_labels = images->are_labels();
    if (!plan_.has_scans()) plan_.sensor_frame = check->frame();
  }
  if (plan_.image_topic.empty()) return;
  if (plan_.elevation.dem.empty()) {
    findings_.push_back(
        {"the targets of " + plan_.image_topic + " need the ground's elevation", "give it: --dem FILE.tif"});
    return;
  }
  look_at_elevation();
}

void RecordingCheck::look_at_elevation() {
  try {
    const ElevationFile file(elevation_source(plan_.elevation, "--origin"));
    const Eigen::AlignedBox3d box = file.extent_world_m();
    facts_.push_back(plan_.elevation.dem + formatted(": x %.0f to %.0f, y %.0f to %.0f, z %.0f to %.0f m in the world",
                                                     box.min().x(), box.max().x(), box.min().y(), box.max().y(),
                                                     box.min().z(), box.max().z()));
    for (const std::string& warning : file.warnings()) findings_.push_back({warning, "docs/offline.md, grid_bag"});
    if (!file.remedy().empty())
      findings_.push_back({plan_.elevation.dem + ": its coordinates have a CRS", file.remedy()});
  } catch (const std::runtime_error& error) {
    findings_.push_back({error.what(), "the images are left out of the lines below"});
    plan_.elevation.dem.clear();
  }
}

void RecordingCheck::compare_clocks() {
  std::vector<double> lags_s;
  for (const auto& check : checks_) {
    if (check->stamps().count() > 0) lags_s.push_back(check->stamps().lag_s());
  }
  if (lags_s.empty()) return;
  std::sort(lags_s.begin(), lags_s.end());
  const double usual_s = lags_s[(lags_s.size() - 1) / 2];
  for (const auto& check : checks_) {
    if (check->stamps().count() == 0) continue;
    const double late_s = check->stamps().lag_s() - usual_s;
    if (std::abs(late_s) < kClocks_s) continue;
    std::string what = check->topic() + formatted(" is stamped %.2f s %s the other topics, by the times of receipt",
                                                  std::abs(late_s), late_s > 0.0 ? "behind" : "ahead of");
    findings_.push_back(
        {std::move(what), std::abs(late_s + 18.0) < 1.0
                              ? "it has the time of GPS, 18 s ahead of UTC: let the driver subtract them"
                              : "let all drivers use one clock (NTP, PTP, or the time of receipt)"});
  }
}

BagOptions RecordingCheck::bag_options() const {
  BagOptions options;
  options.bags = bags_;
  options.tf_topic = plan_.tf_topic;
  options.static_sensor = plan_.pose == MapPlan::Pose::kStaticSensor;
  if (plan_.pose == MapPlan::Pose::kTf) options.world_frame = plan_.world_frame;
  return options;
}

/// Follows the scans with the poses of TF, or as those of a scanner that stands still.
void RecordingCheck::follow_scans() {
  BagPlayer player(bag_options(), {});
  const bool has_poses = plan_.pose == MapPlan::Pose::kTf;
  ScannerMotion motion;
  StandingScanner standing;
  const auto scanner =
      subscribe_scans(player, plan_.scan_topic, RangeLimiterParams{},
                      [&](const Scan& scan, const auto& T_world_lidar, const auto& /*T_world_lidar_end*/) {
                        if (has_poses) {
                          motion.add(scan, T_world_lidar);
                        } else {
                          standing.add(scan);
                        }
                      });
  if (const std::string why = why_nothing_mapped(player); !why.empty()) {
    findings_.push_back({why, "docs/troubleshooting.md"});
    return;
  }
  if (has_poses) {
    motion.report(plan_.scan_topic, check_of(plan_.scan_topic).stamps().period_s(), facts_, findings_);
    advise(*scanner);
  } else {
    standing.report(plan_.scan_topic, findings_);
  }
}

/// Follows the clouds of the recording as a map would be made of them.
void RecordingCheck::follow_clouds() {
  BagPlayer player(bag_options(), {});
  ScannerMotion motion;
  subscribe_clouds(player, plan_.cloud_topic, RangeLimiterParams{}, CloudSliceParams{},
                   [&motion](const Scan& scan, const auto& T_world_lidar, const auto& /*T_world_lidar_end*/) {
                     motion.add(scan, T_world_lidar);
                   });
  if (const std::string why = why_nothing_mapped(player); !why.empty()) {
    findings_.push_back({why, "docs/troubleshooting.md"});
    return;
  }
  constexpr double kAtOnce_s = 0.0;  // whether the clouds lack times is told by what they show
  if (plan_.pose == MapPlan::Pose::kTf) motion.report(plan_.cloud_topic, kAtOnce_s, facts_, findings_);
  for (const std::string& warning : player.warnings()) {
    findings_.push_back({warning, "docs/inputs.md, \"Clouds\""});
  }
}

/// Maps some of the images, spread over the recording, to see whether they show the ground.
void RecordingCheck::follow_images() {
  ImageOptions options;
  (plan_.are_labels ? options.labels_topic : options.image_topic) = plan_.image_topic;
  options.camera_info_topic = plan_.camera_info_topic;
  options.elevation = plan_.elevation;
  options.one_of = (images_ + kImages - 1) / kImages;
  try {
    BagPlayer player(bag_options(), {});
    BagImages images(player, bag_options(), options, GridPipelineParams{}, [](const GridTargets& /*targets*/) {});
    player.play();
    player.check_mapped(images.pipeline().why_nothing());
  } catch (const std::runtime_error& error) {
    findings_.push_back({error.what(), "docs/offline.md, grid_bag"});
  }
}

/// Looks whether IMU and fixes give a pose, and contradict each other.
void RecordingCheck::follow_gps() {
  BagPlayer player(bag_options(), {});
  GpsInsNodeletParams params;
  params.base_frame = plan_.base_frame;
  params.imu_frame = known_frame(plan_.imu_topic);
  params.fix_frame = known_frame(plan_.fix_topic);
  GpsInsInput gps_ins(params, player.tf());
  std::string contradiction;
  std::optional<ros::Time> first_fix, ready;
  player.subscribe<sensor_msgs::Imu>(plan_.imu_topic, [&](const auto& msg, const ros::Time& received) {
    gps_ins.add_imu(*msg, to_nanoseconds(received));
  });
  player.subscribe<sensor_msgs::NavSatFix>(plan_.fix_topic, [&](const auto& msg, const ros::Time& received) {
    if (!first_fix) first_fix = received;
    gps_ins.add_fix(*msg, to_nanoseconds(received));
    keep_contradiction(contradiction, gps_ins.contradiction());
    if (!ready && gps_ins.why_not_ready().empty()) ready = received;
  });
  player.play();
  if (!contradiction.empty()) findings_.push_back({contradiction, "mend the driver (docs/poses.md)"});
  if (ready) {
    facts_.push_back(formatted("the pose by GPS is known %.1f s after the first fix", (*ready - *first_fix).toSec()));
  } else {
    findings_.push_back({"there is no pose by GPS: " + gps_ins.why_not_ready(), "docs/poses.md"});
  }
}

/// What the driver's messages are to be taken for, where they are not as the defaults say.
void RecordingCheck::advise(const ScannerCheck& scanner) {
  const PoseOffset& offset = scanner.pose_offset().estimate();
  facts_.push_back("scan_pose_offset_s: " + pose_offset_text(offset));
  for (const std::string& advice : scanner.advice()) {
    findings_.push_back({plan_.scan_topic + ": " + advice, "in a copy of cfg/map.yaml, with --config"});
  }
  if (scanner.is_out_of_step()) {
    findings_.push_back({pose_offset_advice(scanner.pose_offset()), "in a copy of cfg/map.yaml, with --config"});
  }
}

const TopicCheck& RecordingCheck::check_of(const std::string& topic) const {
  return **std::find_if(checks_.begin(), checks_.end(), [&](const auto& check) { return check->topic() == topic; });
}

/// The frame of a topic's messages if TF leads from it to the base, else the base.
std::string RecordingCheck::known_frame(const std::string& topic) const {
  const std::string& frame = check_of(topic).frame();
  return transforms_.chain(frame).back() == transforms_.chain(plan_.base_frame).back() ? frame : plan_.base_frame;
}

}  // namespace situation_awareness
