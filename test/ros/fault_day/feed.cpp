// SPDX-License-Identifier: BSD-3-Clause
#include "feed.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <sstream>

#include <ros/master.h>
#include <ros/network.h>
#include <ros/xmlrpc_manager.h>
#include <rosgraph_msgs/Clock.h>
#include <boost/make_shared.hpp>

#include "situation_awareness/ros/convert/objects.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/scan_check.hpp"

namespace situation_awareness {
namespace {

constexpr int kBeams = 1081, kObjects = 12;
constexpr int kNoises = 4;       ///< rounds of a scene that differ in their noise
constexpr int kScansAhead = 20;  ///< of transforms; half of them at least
const std::set<std::string> kWhereTimeDecides = {drop_reason::kOvertaken, drop_reason::kQueueFull,
                                                 drop_reason::kNoTransform};

std::int64_t to_count(const std::string& text) {
  try {
    return std::stoll(text);
  } catch (const std::logic_error&) {
    return -1;
  }
}

bool is_drop(const std::string& key) { return key.rfind("dropped: ", 0) == 0; }

}  // namespace

int manager_pid() {
  XmlRpc::XmlRpcValue request, response, uri;
  request[0] = ros::this_node::getName();
  request[1] = ros::names::resolve(kManager);
  if (!ros::master::execute("lookupNode", request, response, uri, false)) return -1;
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(static_cast<std::string>(uri), host, port)) return -1;
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
  XmlRpc::XmlRpcValue caller, answer;
  caller[0] = ros::this_node::getName();
  return client.execute("getPid", caller, answer) ? static_cast<int>(answer[2]) : -1;
}

Feed::Feed(ros::NodeHandle& node, std::uint64_t seed, int under_way)
    : node_(node), random_(seed), under_way_(under_way), scene_seed_(seed) {
  clock_ = node.advertise<rosgraph_msgs::Clock>("/clock", 0);
  tf_ = node.advertise<tf2_msgs::TFMessage>("/tf", 0);
  scan_ = node.advertise<sensor_msgs::LaserScan>("scan", 0);
  map_ = node.subscribe("objects", 0, &Feed::on_map, this, ros::TransportHints().tcpNoDelay());
  diagnostics_ = node.subscribe("/diagnostics", 0, &Feed::on_diagnostics, this);
  Eigen::Isometry3d T_lidar_upside_down = Eigen::Isometry3d::Identity();
  T_lidar_upside_down.rotate(Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitX()));
  static_tf_.sendTransform(transform_to_msg(T_lidar_upside_down, kBegin_ns, kLidarFrame, kUpsideDownFrame));
  make_scene();
}

void Feed::make_scene() {
  scene_.emplace(kBeams, kObjects, scene_seed_);
  loop_.clear();
  for (int i = 0; i < kNoises * SyntheticScene::kPeriodScans; ++i) loop_.push_back(scene_->scan(i));
}

bool Feed::wait_for_stages() {
  const auto there = [this] {
    const std::lock_guard<std::mutex> lock(mutex_);
    return scan_.getNumSubscribers() > 0 && tf_.getNumSubscribers() > 0 && map_.getNumPublishers() > 0 &&
           reports_.size() == kStages.size();
  };
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(60.0);
  while (ros::ok() && !there()) {
    if (ros::WallTime::now() > end) return false;
    ros::WallDuration(0.05).sleep();
  }
  ros::WallDuration(1.0).sleep();  // connections between the stages
  transforms_until_ = slot_;
  return ros::ok();
}

// --- sending

const SyntheticScan& Feed::scan_at(std::int64_t slot) const {
  return loop_[static_cast<std::size_t>(slot) % loop_.size()];
}

sensor_msgs::LaserScanPtr Feed::due() const {
  auto msg = boost::make_shared<sensor_msgs::LaserScan>(scan_to_msg(
      scan_at(slot_).scan, kLidarFrame, SyntheticScene::kRangeMin_m, SyntheticScene::kRangeMax_m, kScanPeriod_s));
  msg->header.stamp = to_ros_time(stamp_ns());
  return msg;
}

sensor_msgs::LaserScanPtr Feed::due_with_beams(int beams) const {
  const SyntheticScene scene(beams, kObjects, scene_seed_);
  const int i = static_cast<int>(slot_ % SyntheticScene::kPeriodScans);
  auto msg = boost::make_shared<sensor_msgs::LaserScan>(scan_to_msg(
      scene.scan(i).scan, kLidarFrame, SyntheticScene::kRangeMin_m, SyntheticScene::kRangeMax_m, kScanPeriod_s));
  msg->header.stamp = to_ros_time(stamp_ns());
  return msg;
}

void Feed::add_transforms(std::int64_t slot, const Eigen::Isometry3d& moved, tf2_msgs::TFMessage& msg) const {
  const SyntheticScan& scan = scan_at(slot);
  const double sweep_s = scan.scan.time_increment_s * static_cast<double>(scan.scan.beams.size() - 1);
  msg.transforms.push_back(transform_to_msg(moved * scan.T_world_lidar, stamp_of(slot), kWorldFrame, kLidarFrame));
  // A little later than the last beam, whose time is rounded.
  msg.transforms.push_back(transform_to_msg(moved * scan.T_world_lidar_end,
                                            stamp_of(slot) + nanoseconds(sweep_s) + 1000, kWorldFrame, kLidarFrame));
}

void Feed::send_transforms(int scans, const Eigen::Isometry3d& moved) {
  tf2_msgs::TFMessage msg;
  for (int i = 0; i < scans; ++i) add_transforms(slot_ + i, moved, msg);
  tf_.publish(msg);
}

void Feed::send_late_transforms(int scans) {
  tf2_msgs::TFMessage msg;
  for (std::int64_t slot = slot_ - scans; slot < slot_; ++slot)
    add_transforms(slot, Eigen::Isometry3d::Identity(), msg);
  tf_.publish(msg);
}

void Feed::provide_transforms() {
  if (transforms_ == Transforms::kNone) return;
  if (transforms_ == Transforms::kEach) return send_transforms(1);
  if (transforms_until_ >= slot_ + kScansAhead / 2) return;
  tf2_msgs::TFMessage msg;
  for (transforms_until_ = std::max(transforms_until_, slot_); transforms_until_ < slot_ + kScansAhead;
       ++transforms_until_) {
    add_transforms(transforms_until_, Eigen::Isometry3d::Identity(), msg);
  }
  tf_.publish(msg);
}

void Feed::transforms(Transforms mode) {
  transforms_ = Transforms::kNone;
  while (slot_ < transforms_until_) send(due(), Fate::kMapped);  // those with transforms already
  transforms_ = mode;
}

void Feed::send(const sensor_msgs::LaserScanPtr& msg, Fate fate, const std::string& reason, bool advance) {
  while (must_map_.size() >= static_cast<std::size_t>(under_way_)) take_maps(true);
  provide_transforms();
  if (!clock_stopped_) {
    rosgraph_msgs::Clock clock;
    clock.clock = to_ros_time(stamp_ns());
    clock_.publish(clock);
  }
  scan_.publish(msg);
  ++sent_;
  ++sent_all_;
  if (fate == Fate::kMapped) must_map_.push_back(to_nanoseconds(msg->header.stamp));
  if (fate == Fate::kDropped) ++expected_drops_["segmentation"][reason];
  if (fate == Fate::kEither) ++either_;
  if (advance) ++slot_;
  take_maps(false);
}

void Feed::stream(int scans) {
  for (int i = 0; i < scans && ros::ok(); ++i) send(due(), Fate::kMapped);
  drain();
}

void Feed::step(int scans) {
  for (int i = 0; i < scans; ++i) stream(1);
}

void Feed::drain() {
  take_maps(false);
  while (!must_map_.empty() && ros::ok()) take_maps(true);
}

void Feed::start_again() {
  drain();
  slot_ = 0;
  latest_map_ns_ = 0;
  transforms_until_ = 0;
  ++scene_seed_;
  make_scene();
  good_since_ns_.reset();
}

std::optional<double> Feed::outlive(const std::function<bool()>& reborn, double timeout_s) {
  const ros::WallTime begin = ros::WallTime::now();
  ros::WallTime due_at = begin;
  latest_map_at_ = begin;
  longest_gap_s_ = 0.0;
  std::optional<std::int64_t> reborn_ns;
  while (ros::ok() && (ros::WallTime::now() - begin).toSec() < timeout_s) {
    if (!reborn_ns && reborn()) reborn_ns = stamp_ns();
    send(due(), Fate::kEither);
    due_at += ros::WallDuration(kScanPeriod_s);
    const ros::WallDuration left = due_at - ros::WallTime::now();
    if (left.toSec() > 0.0) left.sleep();
    take_maps(false);
    if (!reborn_ns || latest_map_ns_ < *reborn_ns) continue;
    highest_id_ = 0;  // ids may begin anew
    forget_accounts();
    return longest_gap_s_;
  }
  return std::nullopt;
}

void Feed::expect_drop(const std::string& stage, const std::string& reason, bool counts_as_received) {
  ++expected_drops_[stage][reason];
  if (counts_as_received) ++foreign_[stage];
}

// --- what comes back

void Feed::on_map(const MappedObjectArrayConstPtr& msg) {
  if (msg->header.stamp.isZero() || msg->header.frame_id != kWorldFrame) return;  // of a fault
  const std::lock_guard<std::mutex> lock(mutex_);
  received_.push_back({msg, ros::WallTime::now()});
  came_.notify_one();
}

void Feed::on_diagnostics(const diagnostic_msgs::DiagnosticArrayConstPtr& msg) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const auto& status : msg->status) {
    const std::string stage = status.name.substr(0, status.name.find(':'));
    if (std::find(kStages.begin(), kStages.end(), stage) == kStages.end()) continue;
    Counts counts;
    for (const auto& pair : status.values) {
      if (pair.key == "received" || pair.key == "processed" || is_drop(pair.key))
        counts[pair.key] = to_count(pair.value);
    }
    if (counts.count("received") == 0) continue;
    counts_[stage] = counts;
    ++reports_[stage];
  }
}

bool Feed::take_maps(bool wait) {
  std::deque<Received> received;
  {
    std::unique_lock<std::mutex> lock(mutex_);
    if (wait) came_.wait_for(lock, std::chrono::seconds(20), [this] { return !received_.empty() || !ros::ok(); });
    received.swap(received_);
  }
  for (const Received& one : received) take_map(one);
  if (!wait || !received.empty() || !ros::ok()) return true;
  if (!must_map_.empty()) {
    fail("no map came for " + std::to_string(must_map_.size()) + " scans from stamp " +
         std::to_string(must_map_.front()) + " on, in 20 s");
    must_map_.clear();
  }
  return false;
}

void Feed::take_map(const Received& received) {
  const std::int64_t map_ns = to_nanoseconds(received.msg->header.stamp);
  ++maps_all_;
  const double gap_s = (received.at - latest_map_at_).toSec();
  constexpr double kOutage_s = 0.5;
  if (gap_s > std::max(kOutage_s, longest_gap_s_)) good_since_ns_.reset();
  longest_gap_s_ = std::max(longest_gap_s_, gap_s);
  latest_map_at_ = received.at;
  latest_map_ns_ = map_ns;
  while (!must_map_.empty() && must_map_.front() < map_ns) {
    fail("no map came for the scan of stamp " + std::to_string(must_map_.front()));
    must_map_.pop_front();
  }
  if (!must_map_.empty() && must_map_.front() == map_ns) {
    must_map_.pop_front();
    ++mapped_all_;
  }
  latest_ = judge(*received.msg);
  for (const MappedObject& ellipse : received.msg->objects) highest_id_ = std::max(highest_id_, ellipse.id);
  if (!latest_.good) return good_since_ns_.reset();
  latest_good_ = latest_;
  if (!good_since_ns_) good_since_ns_ = map_ns;
}

MapState Feed::judge(const MappedObjectArray& map) const {
  constexpr double kNear_m = 0.15, kMaxPositionVariance_m2 = 0.24 * 0.24 * 1.001;
  MapState state;
  Objects objects;
  try {
    objects = objects_from_msg(map);
  } catch (const std::exception& error) {
    state.defect = error.what();
    return state;
  }
  const double slots = seconds_between(kBegin_ns, to_nanoseconds(map.header.stamp)) / kScanPeriod_s;
  std::vector<char> used(objects.objects.size(), 0);
  std::ostringstream defect;
  int number = 0;
  for (const Ellipse& truth : scene_->objects_at(slots)) {
    ++number;
    double nearest_m = kNear_m;
    std::size_t nearest = used.size();
    for (std::size_t i = 0; i < used.size(); ++i) {
      const double distance_m = (objects.objects[i].ellipse_world.center_m - truth.center_m).norm();
      if (used[i] || !(distance_m < nearest_m)) continue;
      nearest_m = distance_m;
      nearest = i;
    }
    if (nearest == used.size()) {
      defect << "object " << number << " missing; ";
      continue;
    }
    used[nearest] = 1;
    state.ids.push_back(objects.objects[nearest].id);
  }
  for (std::size_t i = 0; i < used.size(); ++i) {
    const Object& object = objects.objects[i];
    if (!used[i]) {
      defect << "element " << object.id << " at " << object.ellipse_world.center_m.transpose() << " is on nothing; ";
    }
    const bool bounded = object.covariance.allFinite() && object.covariance(0, 0) <= kMaxPositionVariance_m2 &&
                         object.covariance(1, 1) <= kMaxPositionVariance_m2;
    if (!bounded) defect << "covariance of element " << object.id << " is not bounded; ";
  }
  state.defect = defect.str();
  state.good = state.defect.empty();
  return state;
}

// --- accounts

std::map<std::string, Feed::Counts> Feed::counts() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return counts_;
}

std::string Feed::imbalance(std::map<std::string, Counts>& counts) const {
  std::ostringstream text;
  std::int64_t expected = sent_;
  for (const char* stage : kStages) {
    Counts of = counts[stage];
    if (const auto base = base_.find(stage); base != base_.end()) {
      for (const auto& [key, count] : base->second) of[key] -= count;
    }
    if (const auto foreign = foreign_.find(stage); foreign != foreign_.end()) expected += foreign->second;
    if (of["received"] != expected) text << stage << " received " << of["received"] << " of " << expected << "; ";
    std::int64_t dropped = 0;
    const auto must = expected_drops_.find(stage);
    Counts drops = must == expected_drops_.end() ? Counts() : must->second;
    for (const auto& [key, count] : of) {
      if (!is_drop(key)) continue;
      const std::string reason = key.substr(std::string("dropped: ").size());
      if (reason != drop_reason::kBadMap) dropped += count;
      // Counts that depend on timing are only checked for the balance.
      if (kWhereTimeDecides.count(reason) > 0 && count <= either_ + drops[reason] && count >= drops[reason]) {
        drops.erase(reason);
        continue;
      }
      if (count != drops[reason]) {
        text << stage << " dropped " << count << " of " << drops[reason] << " for '" << reason << "'; ";
      }
      drops.erase(reason);
    }
    for (const auto& [reason, count] : drops) {
      if (count != 0) text << stage << " dropped none of " << count << " for '" << reason << "'; ";
    }
    if (of["received"] != of["processed"] + dropped) {
      text << stage << " received " << of["received"] << ", but processed " << of["processed"] << " and dropped "
           << dropped << "; ";
    }
    expected = of["processed"];
  }
  return text.str();
}

std::string Feed::settle() {
  drain();
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(15.0);
  std::string wrong;
  do {
    auto now = counts();
    wrong = imbalance(now);
    if (wrong.empty()) return "";
    ros::WallDuration(0.05).sleep();
    take_maps(false);
  } while (ros::ok() && ros::WallTime::now() < end);
  forget_accounts();
  return wrong;
}

void Feed::forget_accounts() {
  drain();
  // Nothing is sent: two equal reports of each stage are complete.
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(20.0);
  const auto snapshot = [this](std::map<std::string, std::int64_t>& reports) {
    const std::lock_guard<std::mutex> lock(mutex_);
    reports = reports_;
    return counts_;
  };
  std::map<std::string, std::int64_t> first_reports, reports;
  auto first = snapshot(first_reports);
  while (ros::ok() && ros::WallTime::now() < end) {
    ros::WallDuration(0.1).sleep();
    take_maps(false);
    auto now = snapshot(reports);
    if (now != first) {
      first = now;
      first_reports = reports;
    } else if (std::all_of(kStages.begin(), kStages.end(),
                           [&](const char* stage) { return reports[stage] >= first_reports[stage] + 2; })) {
      break;
    }
  }
  base_ = first;
  sent_ = either_ = 0;
  expected_drops_.clear();
  foreign_.clear();
}

std::vector<std::string> Feed::take_failures() {
  std::vector<std::string> failures;
  failures.swap(failures_);
  return failures;
}

}  // namespace situation_awareness
