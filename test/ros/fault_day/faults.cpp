// SPDX-License-Identifier: BSD-3-Clause
#include "faults.hpp"

#include <signal.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include <nodelet/NodeletUnload.h>
#include <ros/callback_queue.h>
#include <sensor_msgs/PointCloud2.h>
#include <visualization_msgs/MarkerArray.h>
#include <boost/make_shared.hpp>

#include "situation_awareness/DetectionArray.h"
#include "situation_awareness/SegmentArray.h"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/scan_check.hpp"

namespace situation_awareness {
namespace {

using sensor_msgs::LaserScan;
using sensor_msgs::LaserScanPtr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

int draw(Feed& feed, int low, int high) { return low + static_cast<int>(feed.random().uniform() * (high - low + 1)); }

/// Unusual scans that must be mapped.
std::string mapped(Feed& feed, int most, const std::function<void(LaserScan&)>& spoil) {
  for (int left = draw(feed, 1, most); left > 0; --left) {
    const LaserScanPtr msg = feed.due();
    spoil(*msg);
    feed.send(msg, Fate::kMapped);
  }
  return "";
}

/// A fifth of the ranges are what `odd_range_m` gives.
std::string in_places(Feed& feed, const std::function<float()>& odd_range_m) {
  return mapped(feed, 20, [&](LaserScan& msg) {
    for (float& range_m : msg.ranges) {
      if (feed.random().uniform() < 0.2) range_m = odd_range_m();
    }
  });
}

std::string some_ranges(Feed& feed) {
  const std::array<float, 4> odd = {kNan, -kInf, -3.0F, 0.0F};
  return in_places(feed, [&] { return odd[static_cast<std::size_t>(draw(feed, 0, 3))]; });
}

std::string no_ranges(Feed& feed) {
  const std::array<float, 4> values = {kNan, -kInf, -1.0F, 0.0F};
  const float value = values[static_cast<std::size_t>(draw(feed, 0, 3))];
  return mapped(feed, 20, [value](LaserScan& msg) { std::fill(msg.ranges.begin(), msg.ranges.end(), value); });
}

std::string all_free(Feed& feed) {
  return mapped(feed, 40, [](LaserScan& msg) { std::fill(msg.ranges.begin(), msg.ranges.end(), kInf); });
}

std::string holes(Feed& feed) {
  return in_places(feed, [] { return kInf; });
}

std::string malformed(Feed& feed) {
  const std::vector<std::pair<std::string, std::function<void(LaserScan&)>>> kinds = {
      {"empty scan", [](LaserScan& msg) { msg.ranges.clear(); }},
      {"scan of a single beam", [](LaserScan& msg) { msg.ranges.resize(1); }},
      {"scan angles not finite", [](LaserScan& msg) { msg.angle_increment = kNan; }},
      {"scan angles not finite", [](LaserScan& msg) { msg.angle_min = -kInf; }},
      {"angle increment of zero", [](LaserScan& msg) { msg.angle_increment = 0.0F; }},
      {"angle increment of more than half a turn",
       [](LaserScan& msg) {
         msg.ranges.resize(2);
         msg.angle_increment = 4.7F;
       }},
      {"scan of more than one revolution", [](LaserScan& msg) { msg.angle_increment *= 2.0F; }},
      {"range limits are not numbers", [](LaserScan& msg) { msg.range_max = kNan; }},
      {"no frame_id", [](LaserScan& msg) { msg.header.frame_id.clear(); }},
      {"stamp is zero", [](LaserScan& msg) { msg.header.stamp = ros::Time(0); }}};
  for (int left = draw(feed, 1, 5); left > 0; --left) {
    const auto& [reason, spoil] = kinds[static_cast<std::size_t>(draw(feed, 0, static_cast<int>(kinds.size()) - 1))];
    const LaserScanPtr msg = feed.due();
    spoil(*msg);
    feed.send(msg, Fate::kDropped, "bad scan: " + reason);
  }
  return "";
}

std::string other_beams(Feed& feed) {
  const std::array<int, 6> counts = {3, 10, 100, 361, 541, 2161};
  for (int left = draw(feed, 1, 8); left > 0; --left) {
    feed.send(feed.due_with_beams(counts[static_cast<std::size_t>(draw(feed, 0, 5))]), Fate::kMapped);
  }
  return "";
}

/// The same beams in the other order. They are all taken at the stamp: a negative time increment is no number to use.
void reverse(LaserScan& msg) {
  std::reverse(msg.ranges.begin(), msg.ranges.end());
  std::swap(msg.angle_min, msg.angle_max);
  msg.angle_increment = -msg.angle_increment;
  msg.time_increment = -msg.time_increment;
}

void turn_upside_down(LaserScan& msg) {
  msg.header.frame_id = kUpsideDownFrame;
  msg.angle_min = -msg.angle_min;
  msg.angle_max = -msg.angle_max;
  msg.angle_increment = -msg.angle_increment;
}

std::string range_max(Feed& feed) {
  return mapped(feed, 40, [&feed](LaserScan& msg) {
    const float farthest_m = *std::max_element(msg.ranges.begin(), msg.ranges.end());
    const std::array<float, 4> limits_m = {farthest_m, kInf, SyntheticScene::kRangeMax_m,
                                           2.0F * SyntheticScene::kRangeMax_m};
    msg.range_max = limits_m[static_cast<std::size_t>(draw(feed, 0, 3))];
  });
}

std::string short_range_max(Feed& feed) {
  const auto range_max_m = static_cast<float>(feed.random().uniform(2.0, 9.5));
  return mapped(feed, 40, [range_max_m](LaserScan& msg) { msg.range_max = range_max_m; });
}

std::string stamps(Feed& feed, double most_back_s) {
  feed.drain();  // the same stamp twice would count as lost
  for (int left = draw(feed, 1, 10); left > 0; --left) {
    const LaserScanPtr msg = feed.due();
    const std::int64_t back_ns =
        most_back_s > 0.0 ? nanoseconds(feed.random().uniform(kScanPeriod_s, most_back_s)) : SyntheticScene::kStep_ns;
    msg->header.stamp = to_ros_time(feed.stamp_ns() - back_ns);
    feed.send(msg, Fate::kDropped, drop_reason::kStamp, false);
  }
  return "";
}

Injected starts_again(Feed& feed) {
  constexpr int kMostScans = 1000;
  feed.start_again();
  const std::int64_t from_ns = feed.stamp_ns();
  // Transforms are cleared when scans show the reset of time, so earlier ones may be lost.
  feed.transforms(Transforms::kEach);
  for (int i = 0; i < kMostScans && !feed.has_map_of_now(); ++i) {
    feed.send(feed.due(), Fate::kEither);
    ros::WallDuration(0.005).sleep();  // until the map may have come
  }
  feed.transforms(Transforms::kAhead);
  return {"", {}, from_ns};
}

std::string late_transforms(Feed& feed) {
  feed.transforms(Transforms::kNone);
  for (int rounds = draw(feed, 1, 5); rounds > 0; --rounds) {
    const int scans = draw(feed, 1, feed.under_way());
    for (int i = 0; i < scans; ++i) feed.send(feed.due(), Fate::kMapped);
    feed.send_late_transforms(scans);
    feed.drain();
  }
  feed.transforms(Transforms::kAhead);
  return "";
}

std::string missing_transforms(Feed& feed) {
  feed.transforms(Transforms::kNone);
  for (int left = draw(feed, 1, 60); left > 0; --left) feed.send(feed.due(), Fate::kEither);
  feed.transforms(Transforms::kAhead);
  return "";
}

std::string no_transforms(Feed& feed) {
  feed.transforms(Transforms::kNone);
  for (int left = draw(feed, 1, 10); left > 0; --left) {
    feed.send(feed.due(), Fate::kDropped, drop_reason::kNoTransform);
  }
  ros::WallDuration(0.8).sleep();  // longer than ~tf_timeout_s
  feed.transforms(Transforms::kAhead);
  return "";
}

std::string repeated_transforms(Feed& feed) {
  for (int left = draw(feed, 1, 20); left > 0; --left) {
    for (int i = 0; i < 3; ++i) feed.send_transforms(1);
    feed.send(feed.due(), Fate::kMapped);
  }
  return "";
}

std::string no_pose(Feed& feed) {
  feed.transforms(Transforms::kNone);
  Eigen::Isometry3d nowhere = Eigen::Isometry3d::Identity();
  nowhere.translation().setConstant(kNan);
  for (int left = draw(feed, 1, 5); left > 0; --left) {
    feed.send_transforms(1, nowhere);
    feed.send(feed.due(), Fate::kEither);
  }
  feed.transforms(Transforms::kAhead);
  return "";
}

std::string tilted(Feed& feed) {
  feed.transforms(Transforms::kNone);
  Eigen::Isometry3d tilt = Eigen::Isometry3d::Identity();
  tilt.rotate(Eigen::AngleAxisd(radians(85.0), Eigen::Vector3d::UnitX()));
  for (int left = draw(feed, 1, 5); left > 0; --left) {
    feed.send_transforms(1, tilt);
    feed.send(feed.due(), Fate::kDropped, "tilt");
  }
  feed.transforms(Transforms::kAhead);
  return "";
}

std::string jump(Feed& feed) {
  feed.transforms(Transforms::kNone);
  Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
  const double angle_rad = feed.random().uniform(-kPi, kPi);
  moved.translation() << std::cos(angle_rad), std::sin(angle_rad), 0.0;
  feed.send_transforms(1, moved);
  feed.send(feed.due(), Fate::kMapped);
  feed.transforms(Transforms::kAhead);
  return "";
}

std::string flood(Feed& feed) {
  feed.drain();
  const std::int64_t step_ns = nanoseconds(1.0 / feed.random().uniform(500.0, 2000.0));
  const std::int64_t begin_ns = feed.stamp_ns();
  // All transforms are available; time advances by a scan whenever the flood has reached the next one.
  std::int64_t stamp_ns = begin_ns;
  for (int left = draw(feed, 100, 400); left > 0; --left, stamp_ns += step_ns) {
    const LaserScanPtr msg = feed.due();
    msg->header.stamp = to_ros_time(stamp_ns);
    feed.send(msg, Fate::kEither, "", stamp_ns + step_ns >= feed.stamp_ns() + SyntheticScene::kStep_ns);
  }
  feed.skip(1);
  ros::WallDuration(0.2).sleep();
  return "";
}

std::string many_segments(Feed& feed) {
  feed.drain();
  for (int left = draw(feed, 1, 3); left > 0; --left) {
    const LaserScanPtr msg = feed.due();
    constexpr std::size_t kRuns = 2500, kRun = 4;
    msg->angle_increment = (msg->angle_max - msg->angle_min) / (kRuns * kRun - 1);
    msg->time_increment = 0.0F;
    msg->ranges.clear();
    for (std::size_t run = 0; run < kRuns; ++run) {
      msg->ranges.insert(msg->ranges.end(), kRun, static_cast<float>(feed.random().uniform(1.0, 9.0)));
    }
    feed.send(msg, Fate::kMapped);
    feed.drain();
  }
  return "";
}

std::string many_objects(Feed& feed) {
  feed.drain();
  for (int left = draw(feed, 1, 3); left > 0; --left) {
    const LaserScanPtr msg = feed.due();
    constexpr int kPosts = 1000, kBeams = 20;  // half of them on the post, in turn near and far
    msg->angle_increment = (msg->angle_max - msg->angle_min) / (kPosts * kBeams - 1);
    msg->time_increment = 0.0F;
    msg->ranges.assign(kPosts * kBeams, 9.9F);
    for (int post = 0; post < kPosts; ++post) {
      const double distance_m = post % 2 == 0 ? 3.0 : 6.0;
      const double half_rad = 0.25 * kBeams * static_cast<double>(msg->angle_increment);
      const double radius_m = distance_m * std::sin(half_rad);
      for (int beam = 0; beam < kBeams; ++beam) {
        const double off_rad = (beam - 0.5 * (kBeams - 1)) * static_cast<double>(msg->angle_increment);
        const double aside_m = distance_m * std::sin(off_rad);
        if (std::abs(aside_m) >= radius_m) continue;
        msg->ranges[static_cast<std::size_t>(post * kBeams + beam)] =
            static_cast<float>(distance_m * std::cos(off_rad) - std::sqrt(radius_m * radius_m - aside_m * aside_m));
      }
    }
    feed.send(msg, Fate::kMapped);
    feed.drain();
  }
  return "";
}

std::string foreign_messages(Feed& feed) {
  ros::Publisher segments = feed.node().advertise<SegmentArray>("segments", 10);
  ros::Publisher detections = feed.node().advertise<DetectionArray>("detections", 10);
  ros::Publisher map = feed.node().advertise<MappedObjectArray>("objects", 10);
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(10.0);
  // Maps have one more subscriber: the feed itself.
  while (segments.getNumSubscribers() < 1 || detections.getNumSubscribers() < 1 || map.getNumSubscribers() < 2) {
    if (ros::WallTime::now() > end) return "not heard by the stages within 10 s";
    ros::WallDuration(0.01).sleep();
  }
  feed.drain();
  SegmentArray bad_segments;
  bad_segments.header.stamp = to_ros_time(feed.stamp_ns());
  bad_segments.resolution = 0.01;
  bad_segments.segments.resize(1);
  bad_segments.segments[0].count = 100;
  segments.publish(bad_segments);
  feed.expect_drop("detection", drop_reason::kBadMessage, true);
  DetectionArray bad_detections;
  bad_detections.header.stamp = bad_segments.header.stamp;
  bad_detections.detections.resize(1);
  bad_detections.detections[0].x = kNan;
  detections.publish(bad_detections);
  feed.expect_drop("mapping", drop_reason::kBadMessage, true);
  MappedObjectArray bad_map;
  bad_map.header.stamp = bad_segments.header.stamp;
  bad_map.header.frame_id = "elsewhere";
  map.publish(bad_map);
  feed.expect_drop("segmentation", drop_reason::kBadMap, false);
  feed.expect_drop("detection", drop_reason::kBadMap, false);
  ros::WallDuration(0.1).sleep();  // until all has been sent
  return "";
}

std::string viewers(Feed& feed) {
  int markers = 0, clouds = 0;
  ros::CallbackQueue queue;
  ros::NodeHandle node(feed.node());
  node.setCallbackQueue(&queue);
  const ros::Subscriber marker_viewer = node.subscribe<visualization_msgs::MarkerArray>(
      "semantic_map_markers", 1, [&markers](const visualization_msgs::MarkerArrayConstPtr&) { ++markers; });
  const ros::Subscriber cloud_viewer = node.subscribe<sensor_msgs::PointCloud2>(
      "hit_labels", 1, [&clouds](const sensor_msgs::PointCloud2ConstPtr&) { ++clouds; });
  for (int i = 0; i < 200 && (markers == 0 || clouds == 0); ++i) {
    feed.stream(1);
    queue.callAvailable(ros::WallDuration(0.02));
  }
  return markers > 0 && clouds > 0 ? "" : "no markers or no cloud came within 200 scans";
}

std::string clock_stops(Feed& feed) {
  feed.stop_clock(true);
  feed.stream(draw(feed, 1, 200));
  feed.stop_clock(false);
  return "";
}

std::string silence(Feed& feed, double from_s, double to_s) {
  feed.drain();
  feed.skip(static_cast<int>(feed.random().uniform(from_s, to_s) / kScanPeriod_s));
  return "";
}

/// `end` ends something that restarts by itself, and returns the error.
Injected death(Feed& feed, const std::function<std::string()>& end, const std::function<bool()>& reborn) {
  constexpr double kTimeout_s = 120.0;
  feed.drain();
  feed.transforms(Transforms::kEach);
  feed.drain();  // no unprocessed scans that would be lost
  const std::int64_t latest_ns = feed.stamp_ns() - SyntheticScene::kStep_ns;
  const std::string wrong = end();
  if (!wrong.empty()) return {wrong, {}, {}};
  const std::optional<double> down_s = feed.outlive(reborn, kTimeout_s);
  feed.transforms(Transforms::kAhead);
  if (!down_s) return {"no maps again within 120 s", {}, {}};
  return {"", down_s, latest_ns};
}

std::function<Injected(Feed&)> end_manager(int signal) {
  return [signal](Feed& feed) {
    const int pid = manager_pid();
    const auto end = [signal, pid] { return pid > 0 && kill(pid, signal) == 0 ? "" : "no process to end"; };
    return death(feed, end, [pid] {
      const int now = manager_pid();
      return now > 0 && now != pid;
    });
  };
}

Injected unload_stage(Feed& feed) {
  const char* const stage = kStages[static_cast<std::size_t>(draw(feed, 0, 2))];
  const auto end = [stage] {
    nodelet::NodeletUnload unload;
    unload.request.name = ros::names::resolve(stage);
    const bool unloaded = ros::service::call(std::string(kManager) + "/unload_nodelet", unload);
    return unloaded && unload.response.success ? "" : "not unloaded";
  };
  return death(feed, end, [] { return true; });  // it has ended when the service responds
}

/// An injection that ends no process.
std::function<Injected(Feed&)> alive(std::function<std::string(Feed&)> inject) {
  return [inject = std::move(inject)](Feed& feed) { return Injected{inject(feed), {}, {}}; };
}

}  // namespace

std::vector<Fault> all_faults() {
  const char* kMapped = "every scan is mapped, ids stay";
  const char* kDropped = "all are dropped with the right reason, ids stay";
  return {
      {"no fault", "none, for comparison", kMapped, Ids::kKept, false,
       alive([](Feed& /*feed*/) { return std::string(); })},
      {"invalid ranges", "1 to 20 scans, a fifth of the ranges NaN, -inf, -3 or 0", kMapped, Ids::kKept, false,
       alive(some_ranges)},
      {"no valid range", "1 to 20 scans all NaN, -inf, -1 or 0", "every scan is mapped; moving objects may get new ids",
       Ids::kFree, false, alive(no_ranges)},
      {"no returns", "1 to 40 scans all +inf", "every scan is mapped; elements in free space may be deleted",
       Ids::kFree, false, alive(all_free)},
      {"some returns missing", "1 to 20 scans, a fifth of the ranges +inf",
       "every scan is mapped; elements in free space may be deleted", Ids::kFree, false, alive(holes), false},
      {"malformed scans",
       "1 to 5 scans: no beam, one beam, angles or limits not finite, no increment, two turns, no frame, stamp zero",
       kDropped, Ids::kKept, false, alive(malformed)},
      {"beam count changes", "1 to 8 scans of 3, 10, 100, 361, 541 or 2161 beams", kMapped, Ids::kKept, false,
       alive(other_beams)},
      {"negative increment", "1 to 40 scans with the beams in the other order", kMapped, Ids::kKept, false,
       alive([](Feed& feed) { return mapped(feed, 40, reverse); })},
      {"upside down", "1 to 40 scans of a scanner mounted upside down", kMapped, Ids::kKept, false,
       alive([](Feed& feed) { return mapped(feed, 40, turn_upside_down); })},
      {"range_max varies", "1 to 40 scans: the farthest range of the scan, 30 m, 60 m, infinite", kMapped, Ids::kKept,
       false, alive(range_max)},
      {"range_max too short", "1 to 40 scans: 2 to 9.5 m, so that farther hits count as no return",
       "every scan is mapped; objects out of range may get new ids", Ids::kFree, false, alive(short_range_max)},
      {"stamp repeats", "1 to 10 scans", kDropped, Ids::kKept, false,
       alive([](Feed& feed) { return stamps(feed, 0.0); })},
      {"stamp goes back", "1 to 10 scans, by up to 0.9 s", kDropped, Ids::kKept, false,
       alive([](Feed& feed) { return stamps(feed, 0.9); })},
      {"time is reset", "stamps and /clock start from the beginning, in another room", "a new map, ids not used before",
       Ids::kNew, false, starts_again},
      {"/clock stands still", "for up to 10 s, while scans go on", kMapped, Ids::kKept, false, alive(clock_stops)},
      {"transforms late", "up to 5 times, those of 1 to 3 scans come at once", kMapped, Ids::kKept, false,
       alive(late_transforms)},
      {"transforms missing", "for 1 to 60 scans", "scans wait, then are mapped or dropped", Ids::kFree, false,
       alive(missing_transforms)},
      {"transforms time out", "for 1 to 10 scans, longer than ~tf_timeout_s", "all dropped: no transform", Ids::kFree,
       false, alive(no_transforms)},
      {"transforms repeated", "three times, for 1 to 20 scans", kMapped, Ids::kKept, false, alive(repeated_transforms)},
      {"transforms not finite", "for 1 to 5 scans", "mapped between good transforms or dropped, ids stay", Ids::kKept,
       false, alive(no_pose)},
      {"scanner on its side", "transforms tilted by 85 deg, 1 to 5 scans", "all dropped: tilt, ids stay", Ids::kKept,
       false, alive(tilted)},
      {"pose jumps", "one scan from 1 m beside", kMapped, Ids::kKept, false, alive(jump)},
      {"flood", "100 to 400 scans at 500 to 2000 Hz of their stamps", "mapped, or dropped as overtaken, ids stay",
       Ids::kKept, false, alive(flood)},
      {"scanner silent for a moment", "no scans for 0.1 to 1 s", "moving objects may get new ids", Ids::kFree, false,
       alive([](Feed& feed) { return silence(feed, 0.1, 1.0); })},
      {"scanner silent for longer", "no scans for 1 to 30 s", "moving objects may get new ids", Ids::kFree, false,
       alive([](Feed& feed) { return silence(feed, 1.0, 30.0); })},
      {"thousands of segments", "1 to 3 scans of 2500 segments of 4 beams at random ranges", "every scan is mapped",
       Ids::kFree, false, alive(many_segments)},
      {"a thousand objects", "1 to 3 scans of 1000 posts, 20,000 beams", "every scan is mapped", Ids::kFree, false,
       alive(many_objects)},
      {"inconsistent messages", "inconsistent segments, a detection with NaN, a map in another frame", kDropped,
       Ids::kKept, false, alive(foreign_messages)},
      {"subscribers come and go", "subscribers of semantic_map_markers and hit_labels", kMapped, Ids::kKept, false,
       alive(viewers)},
      {"manager killed", "SIGKILL", "respawn restarts all, with a new map", Ids::kRestart, true, end_manager(SIGKILL)},
      {"manager terminated", "SIGTERM", "respawn restarts all, with a new map", Ids::kRestart, true,
       end_manager(SIGTERM)},
      {"a stage unloaded", "by the manager's service: one of the three, at random",
       "the manager loads it again, the others keep running", Ids::kFree, true, unload_stage},
  };
}

}  // namespace situation_awareness
