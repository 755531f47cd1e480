// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include <sensor_msgs/Imu.h>
#include <Eigen/Geometry>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/registration/map_alignment.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/inertial_navigation.hpp"
#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// Where an IMU and fixes of a GPS receiver are.
struct NavigationOptions {
  std::string imu_topic = "/imu", fix_topic = "/fix";
  std::string origin;  ///< of the world, as text; empty: the first good fix
};

/// --imu-topic, --fix-topic and --origin.
void add_navigation_options(CommandLine& app, NavigationOptions& options);

/// Throws CommandLineError if the origin is none.
void check_origin(const NavigationOptions& options);

/// Options of a bag whose scans wait for the pose to be ready.
BagOptions with_backlog(BagOptions options);

/// Inertial navigation while a bag is played, in the player's transforms: gives the player the poses of the base.
class BagNavigation {
 public:
  /// `program`: its name, for warnings. Throws as BagPlayer::subscribe and GpsInsParams::validate.
  BagNavigation(const std::string& program, BagPlayer& player, const BagOptions& bag, const NavigationOptions& options,
                const std::string& base_frame, const GpsInsParams& params);
  BagNavigation(const BagNavigation&) = delete;
  BagNavigation& operator=(const BagNavigation&) = delete;

  /// Maps a scan at its first and last beam, and returns how scans are placed in the map.
  using Map =
      std::function<const MapAlignment&(const Scan& scan, const Eigen::Isometry3d& T_odom_lidar,
                                        const Eigen::Isometry3d& T_odom_lidar_end, const InertialPlacement& placement)>;
  /// Uses the map after a scan, and the pose of the base at its stamp as it was known then.
  using Use = std::function<void(const Scan& scan, const WorldPose& pose)>;

  /// Subscribes the player to scans (bag/scans.hpp): all are mapped, those at which the pose was known are used.
  void subscribe_scans(const std::string& topic, const RangeLimiterParams& params, const std::string& lidar_frame,
                       Map map, Use use);

  /// Why no map was used, in one sentence: that without a hit where one was, else why there was no pose; empty if one
  /// was used and had hits.
  std::string why_nothing(const std::string& why_no_hit) const;

  /// Prints what was refused, and warns of measurements that contradicted each other at any time.
  void print_summary();

 private:
  std::string why_not_ready() const;
  std::string known(const std::string& frame, const std::string& topic) const;
  void begin();
  void add(const sensor_msgs::Imu& msg, std::int64_t recorded_ns);

  void warn(const std::string& what) const;

  std::string program_;
  BagPlayer& player_;
  GpsInsNodeletParams params_;
  std::string imu_topic_, fix_topic_, imu_frame_, fix_frame_;
  std::optional<InertialNavigation> navigation_;
  Counters refused_;
  std::string contradiction_;
  std::size_t mapped_ = 0, used_ = 0;  ///< scans
};

}  // namespace situation_awareness
