// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/navigation.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

#include <sensor_msgs/NavSatFix.h>

#include "command_line.hpp"
#include "situation_awareness/ros/bag/messages.hpp"
#include "situation_awareness/ros/bag/scans.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/transform_queue.hpp"

namespace situation_awareness {
namespace {

/// Of the first message; empty where there is none.
template <class Message>
std::string frame_of(const BagOptions& bag, const std::string& topic) {
  std::string frame;
  for_each_message<Message>(bag, topic, [&frame](const auto& msg) {
    frame = tf2_frame(msg->header.frame_id);
    return false;
  });
  return frame;
}

void add_to(Counters& sum, const Counters& counters) {
  for (const auto& [reason, count] : counters) sum[reason] += count;
}

}  // namespace

void add_navigation_options(CommandLine& app, NavigationOptions& options) {
  const auto text = [&app](const char* name, std::string& value, const char* type, const char* what) {
    app.add_option(name, value, what).type_name(type);
  };
  text("--imu-topic", options.imu_topic, "TOPIC", "sensor_msgs/Imu");
  text("--fix-topic", options.fix_topic, "TOPIC", "sensor_msgs/NavSatFix");
  text("--origin", options.origin, "LAT,LON,ALT", "of the world, in degrees and m (default: the first good fix)");
}

void check_origin(const NavigationOptions& options) {
  if (!options.origin.empty()) check_option([&options] { parse_geodetic_position(options.origin, "--origin"); });
}

BagOptions with_backlog(BagOptions options) {
  options.tf_timeout_s = std::max(options.tf_timeout_s, InertialNavigation::kBacklog_s);
  return options;
}

BagNavigation::BagNavigation(const std::string& program, BagPlayer& player, const BagOptions& bag,
                             const NavigationOptions& options, const std::string& base_frame,
                             const GpsInsParams& params)
    : program_(program),
      player_(player),
      imu_topic_(options.imu_topic),
      fix_topic_(options.fix_topic),
      imu_frame_(frame_of<sensor_msgs::Imu>(bag, options.imu_topic)),
      fix_frame_(frame_of<sensor_msgs::NavSatFix>(bag, options.fix_topic)) {
  params.validate();
  params_.base_frame = tf2_frame(base_frame);
  params_.origin = options.origin;
  params_.gps_ins = params;
  player.subscribe<sensor_msgs::Imu>(
      options.imu_topic, [this](const auto& msg, const ros::Time& recorded) { add(*msg, to_nanoseconds(recorded)); });
  player.subscribe<sensor_msgs::NavSatFix>(options.fix_topic, [this](const auto& msg, const ros::Time& recorded) {
    begin();
    navigation_->add_fix(*msg, to_nanoseconds(recorded));
    keep_contradiction(contradiction_, navigation_->input().contradiction());
  });
}

void BagNavigation::subscribe_scans(const std::string& topic, const RangeLimiterParams& params,
                                    const std::string& lidar_frame, Map map, Use use) {
  situation_awareness::subscribe_scans(
      player_, topic, params,
      [this, map = std::move(map), use = std::move(use)](const Scan& scan, const Eigen::Isometry3d& T_odom_lidar,
                                                         const Eigen::Isometry3d& T_odom_lidar_end) {
        const Eigen::Isometry3d T_odom_base = player_.T_world_base_at(scan.stamp_ns);
        const InertialPlacement placement = navigation_->placement_at(scan.stamp_ns, T_odom_base, T_odom_lidar);
        const MapAlignment& alignment = player_.timed(
            [&]() -> const MapAlignment& { return map(scan, T_odom_lidar, T_odom_lidar_end, placement); });
        ++mapped_;
        if (!navigation_->was_ready_at(scan.stamp_ns)) return;  // mapped, but the pose was not known then
        use(scan, navigation_->pose_at(scan.stamp_ns, T_odom_base, alignment));
        ++used_;
      },
      lidar_frame);
}

std::string BagNavigation::why_nothing(const std::string& why_no_hit) const {
  if (used_ > 0) return why_no_hit;
  const std::string why_not = why_not_ready();
  return mapped_ > 0 && why_not.empty() ? "the pose was not known before the last scan" : why_not;
}

/// Why there is no pose at the end, in one sentence, after what contradicted each other; empty if there is.
std::string BagNavigation::why_not_ready() const {
  const std::string why = navigation_ ? navigation_->input().why_not_ready() : "there is no sample of the IMU";
  return why.empty() || contradiction_.empty() ? why : contradiction_ + "; " + why;
}

void BagNavigation::print_summary() {
  if (!contradiction_.empty()) warn(contradiction_);
  const std::string why_not = why_not_ready();
  if (!why_not.empty()) std::printf("gps_ins: not ready: %s\n", why_not.c_str());
  Counters all = refused_;
  if (navigation_) add_to(all, navigation_->input().counters());
  GpsIns* const filter = navigation_ ? navigation_->input().filter() : nullptr;
  if (filter != nullptr) {
    add_to(all, filter->counters());
    const NisMonitor::Summary nis = filter->nis(GpsInsSensor::kFix).summarise();
    if (nis.matches > 0) {
      std::printf("gps_ins: NIS of fixes %.2f, 95 %% bounds %.2f to %.2f\n", nis.mean, nis.low, nis.high);
    }
  }
  if (navigation_ && navigation_->late_fixes() > 0) all["fixes later than their patience"] = navigation_->late_fixes();
  for (const auto& [reason, count] : all) {
    std::printf("gps_ins: %llu %s\n", static_cast<unsigned long long>(count), reason.c_str());
  }
}

void BagNavigation::warn(const std::string& what) const {
  std::fprintf(stderr, "%s: warning: %s\n", program_.c_str(), what.c_str());
}

/// The frame itself, if its place on the base is known, else the base.
std::string BagNavigation::known(const std::string& frame, const std::string& topic) const {
  const std::string& base_frame = params_.base_frame;
  const Taken now{frame, ros::Time(), ros::Time()};
  if (frame == base_frame || (!frame.empty() && has_transforms(player_.tf(), base_frame, now))) return frame;
  const std::string why = frame.empty() ? "has no frame_id" : missing_transform(player_.tf(), base_frame, now);
  warn(topic + " " + why + ": taken for " + base_frame);
  return base_frame;
}

/// With the transforms that the bag has from the beginning.
void BagNavigation::begin() {
  if (navigation_) return;
  params_.imu_frame = known(imu_frame_, imu_topic_);
  params_.fix_frame = known(fix_frame_, fix_topic_);
  navigation_.emplace(params_, player_.tf(),
                      InertialNavigation::Use{[this](const auto& T_odom_base) { player_.add_pose(T_odom_base); },
                                              [this] { player_.forget_poses(); }});
}

void BagNavigation::add(const sensor_msgs::Imu& msg, std::int64_t recorded_ns) {
  begin();
  const std::string reason = navigation_->add_imu(msg, recorded_ns);
  if (!reason.empty()) ++refused_[reason];
}

}  // namespace situation_awareness
