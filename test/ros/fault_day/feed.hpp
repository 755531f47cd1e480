// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_msgs/TFMessage.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include "situation_awareness/MappedObjectArray.h"
#include "situation_awareness/common/random.hpp"
#include "synthetic_scene.hpp"

namespace situation_awareness {

constexpr const char* kManager = "map_manager";
constexpr std::array<const char*, 3> kStages = {"segmentation", "detection", "mapping"};
constexpr const char* kWorldFrame = "world";
constexpr const char* kLidarFrame = "lidar";
constexpr const char* kUpsideDownFrame = "lidar_upside_down";  ///< turned about the lidar's x axis by pi
constexpr double kScanPeriod_s = 1e-9 * static_cast<double>(SyntheticScene::kStep_ns);

/// Expected outcome of a scan.
enum class Fate {
  kMapped,   ///< a map with its stamp
  kDropped,  ///< dropped by the segmentation nodelet for one known reason
  kEither,   ///< mapped, or dropped because there is no time or no transform for it: the machine's speed decides
};

enum class Transforms {
  kAhead,  ///< known before their scans
  kEach,   ///< sent with their scans
  kNone,   ///< not sent
};

/// Process id of the manager, -1 if it is not known.
int manager_pid();

/// State of a map against the truth.
struct MapState {
  bool good = false;               ///< each object once, nothing else, all bounded
  std::string defect;              ///< why not
  std::vector<std::uint64_t> ids;  ///< of the objects, if it is good
};

/// A simulated scanner with transforms in lock-step with the resulting map, which it compares with the truth. Time is
/// simulated: scan k since a reset of time has the stamp kBegin_ns + k * SyntheticScene::kStep_ns.
class Feed {
 public:
  /// `under_way`: largest number of scans that wait for their maps, and so the lag of the map used for expected
  /// outlines. More are faster; with one there is time for each on a busy machine.
  Feed(ros::NodeHandle& node, std::uint64_t seed, int under_way);

  /// Wait until all stages report. False on timeout.
  bool wait_for_stages();

  /// Good scans, a few unprocessed at a time, each to be mapped.
  void stream(int scans);
  /// The same, the next one when the map of the previous one has come, for any speed of the stages.
  void step(int scans);

  // --- for faults
  /// The scan that is due.
  sensor_msgs::LaserScanPtr due() const;
  /// The same with another number of beams, over the same field of view.
  sensor_msgs::LaserScanPtr due_with_beams(int beams) const;
  /// Whether time advances by a scan with each.
  void send(const sensor_msgs::LaserScanPtr& msg, Fate fate, const std::string& reason = "", bool advance = true);
  void transforms(Transforms mode);
  /// Transforms of `scans` scans from the next one on, moved and rotated.
  void send_transforms(int scans, const Eigen::Isometry3d& moved = Eigen::Isometry3d::Identity());
  /// As `transforms(kNone)`, and transforms of the scans before the next one are sent now.
  void send_late_transforms(int scans);
  void skip(int scans) { slot_ += scans; }
  void stop_clock(bool stopped) { clock_stopped_ = stopped; }
  /// Reset time, in another scene.
  void start_again();
  /// Wait for all maps that must come.
  void drain();
  /// Scans in wall time, which may be lost, until a map of one that was sent after `reborn`: the time without a map, in
  /// wall time; nothing after `timeout_s`.
  std::optional<double> outlive(const std::function<bool()>& reborn, double timeout_s);
  /// Messages of other publishers, which a stage must drop for this reason.
  void expect_drop(const std::string& stage, const std::string& reason, bool counts_as_received);

  // --- what came of it
  std::int64_t stamp_ns() const { return stamp_of(slot_); }
  /// Whether a map has come since the time was reset.
  bool has_map_of_now() const { return latest_map_ns_ > 0; }
  std::int64_t sent() const { return sent_all_; }
  std::int64_t mapped() const { return mapped_all_; }
  std::int64_t maps() const { return maps_all_; }
  /// The stamp since which every map was good; nothing if the latest is not.
  std::optional<std::int64_t> good_since_ns() const { return good_since_ns_; }
  const MapState& latest() const { return latest_; }
  const MapState& latest_good() const { return latest_good_; }
  std::uint64_t highest_id() const { return highest_id_; }
  /// Compare the stages' counts of received, processed and dropped messages with those sent. Empty if all agree.
  std::string settle();
  /// The stages' earlier counts are unknown after a restart.
  void forget_accounts();
  std::vector<std::string> take_failures();
  int under_way() const { return under_way_; }
  ros::NodeHandle& node() { return node_; }
  Random& random() { return random_; }

 private:
  using Counts = std::map<std::string, std::int64_t>;
  struct Received {
    MappedObjectArrayConstPtr msg;
    ros::WallTime at;
  };

  static constexpr std::int64_t kBegin_ns = 1'700'000'000 * kNanosecondsPerSecond;
  static std::int64_t stamp_of(std::int64_t slot) { return kBegin_ns + slot * SyntheticScene::kStep_ns; }

  void make_scene();
  const SyntheticScan& scan_at(std::int64_t slot) const;
  void add_transforms(std::int64_t slot, const Eigen::Isometry3d& moved, tf2_msgs::TFMessage& msg) const;
  void provide_transforms();
  void on_map(const MappedObjectArrayConstPtr& msg);
  void on_diagnostics(const diagnostic_msgs::DiagnosticArrayConstPtr& msg);
  /// Evaluate received maps; optionally wait for at least one, false on timeout.
  bool take_maps(bool wait);
  void take_map(const Received& received);
  MapState judge(const MappedObjectArray& map) const;
  std::string imbalance(std::map<std::string, Counts>& counts) const;
  std::map<std::string, Counts> counts() const;
  void fail(const std::string& what) { failures_.push_back(what); }

  ros::NodeHandle& node_;
  Random random_;
  int under_way_;
  ros::Publisher clock_, tf_, scan_;
  ros::Subscriber map_, diagnostics_;
  tf2_ros::StaticTransformBroadcaster static_tf_;

  std::uint64_t scene_seed_;
  std::optional<SyntheticScene> scene_;
  std::vector<SyntheticScan> loop_;
  std::int64_t slot_ = 0;
  std::int64_t transforms_until_ = 0;  ///< slot from which on they have not been sent
  Transforms transforms_ = Transforms::kAhead;
  bool clock_stopped_ = false;

  std::deque<std::int64_t> must_map_;  ///< stamps, ns
  std::int64_t sent_ = 0;              ///< since the accounts began
  std::int64_t either_ = 0;            ///< of them, those that may be dropped
  std::int64_t sent_all_ = 0, mapped_all_ = 0, maps_all_ = 0;
  std::map<std::string, Counts> expected_drops_;  ///< by stage and reason, since the accounts began
  Counts foreign_;                                ///< received from others, by stage
  std::map<std::string, Counts> base_;            ///< what the stages said when the accounts began

  std::optional<std::int64_t> good_since_ns_;
  MapState latest_, latest_good_;
  std::uint64_t highest_id_ = 0;
  ros::WallTime latest_map_at_;
  std::int64_t latest_map_ns_ = 0;
  double longest_gap_s_ = 0.0;  ///< between two maps, since it was asked for, in wall time
  std::vector<std::string> failures_;

  mutable std::mutex mutex_;  ///< of what callbacks write: all below
  std::condition_variable came_;
  std::deque<Received> received_;
  std::map<std::string, Counts> counts_;
  std::map<std::string, std::int64_t> reports_;  ///< of each stage
};

}  // namespace situation_awareness
