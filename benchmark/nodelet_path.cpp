// SPDX-License-Identifier: BSD-3-Clause
// Time and cost from a scan at the segmentation nodelet to its map. This program is the manager into which
// launch/map.launch loads the nodelets (nodelet_path.launch), so both are measured in its process.
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include <nodelet/loader.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/spinner.h>
#include <sensor_msgs/LaserScan.h>
#include <boost/make_shared.hpp>

#include "situation_awareness/MappedObjectArray.h"
#include "situation_awareness/common/random.hpp"

namespace situation_awareness {
namespace {

constexpr int kBeams = 1081;
constexpr int kWarmUp = 60;  // scans
constexpr double kFieldOfView_rad = 4.71238898;
constexpr double kRangeSigma_m = 0.01;

/// Round objects side by side, every second one behind a gap, so that each is a segment.
std::vector<float> ranges_to(int objects) {
  const double spacing_rad = kFieldOfView_rad / objects;
  std::vector<float> ranges(kBeams, std::numeric_limits<float>::infinity());
  for (int i = 0; i < kBeams; ++i) {
    const double angle_rad = kFieldOfView_rad * i / (kBeams - 1);
    const int object = std::min(static_cast<int>(angle_rad / spacing_rad), objects - 1);
    const double distance_m = object % 2 == 0 ? 3.0 : 6.0;
    const double radius_m = std::min(0.3, 0.35 * spacing_rad * distance_m);
    const double off_rad = angle_rad - (object + 0.5) * spacing_rad;
    const double aside_m = distance_m * std::sin(off_rad);
    if (std::abs(aside_m) >= radius_m || std::cos(off_rad) <= 0.0) continue;
    ranges[static_cast<std::size_t>(i)] =
        static_cast<float>(distance_m * std::cos(off_rad) - std::sqrt(radius_m * radius_m - aside_m * aside_m));
  }
  return ranges;
}

double cpu_s() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double quantile(const std::vector<double>& sorted, double part) {
  return sorted[static_cast<std::size_t>(part * static_cast<double>(sorted.size() - 1) + 0.5)];
}

/// When the map of each stamp was published, and how many objects the latest holds.
class Maps {
 public:
  void receive(const ros::MessageEvent<MappedObjectArray const>& event) {
    const std::lock_guard<std::mutex> lock(mutex_);
    // In one process a message is received by the call that publishes it.
    published_[event.getConstMessage()->header.stamp] = event.getReceiptTime();
    objects_ = event.getConstMessage()->objects.size();
  }

  std::map<ros::Time, ros::Time> published() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return published_;
  }

  std::size_t objects() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return objects_;
  }

 private:
  mutable std::mutex mutex_;
  std::map<ros::Time, ros::Time> published_;
  std::size_t objects_ = 0;
};

int run(int objects, double rate_hz, int scans) {
  ros::NodeHandle node;
  ros::CallbackQueue queue;
  ros::NodeHandle own_node;
  own_node.setCallbackQueue(&queue);
  ros::AsyncSpinner spinner(1, &queue);
  spinner.start();
  Maps maps;
  ros::Publisher publisher = node.advertise<sensor_msgs::LaserScan>("scan", 1);
  const ros::Subscriber subscriber = own_node.subscribe("objects", 0, &Maps::receive, &maps);
  while (ros::ok() && (publisher.getNumSubscribers() == 0 || subscriber.getNumPublishers() == 0)) {
    ros::WallDuration(0.05).sleep();
  }
  ros::WallDuration(1.0).sleep();  // the other stages and the transform

  Random random(1);
  const std::vector<float> ranges = ranges_to(objects);
  std::vector<ros::Time> stamps;
  double cpu_before_s = 0.0;
  ros::WallTime due = ros::WallTime::now();
  for (int i = 0; i < kWarmUp + scans && ros::ok(); ++i) {
    if (i == kWarmUp) cpu_before_s = cpu_s();
    auto msg = boost::make_shared<sensor_msgs::LaserScan>();
    msg->header.frame_id = "lidar";
    msg->angle_increment = static_cast<float>(kFieldOfView_rad / (kBeams - 1));
    msg->angle_min = static_cast<float>(-0.5 * kFieldOfView_rad);
    msg->angle_max = -msg->angle_min;
    msg->range_min = 0.1F;
    msg->range_max = 30.0F;
    msg->ranges = ranges;
    for (float& range_m : msg->ranges) range_m += static_cast<float>(kRangeSigma_m * random.normal());
    due += ros::WallDuration(1.0 / rate_hz);
    const ros::WallDuration early = due - ros::WallTime::now();
    if (early.toSec() > 0.0) early.sleep();
    msg->header.stamp = ros::Time::now();
    stamps.push_back(msg->header.stamp);
    publisher.publish(msg);
  }
  ros::WallDuration(1.0).sleep();
  const double cpu_per_scan_ms = 1e3 * (cpu_s() - cpu_before_s) / scans;

  const std::map<ros::Time, ros::Time> published = maps.published();
  std::vector<double> latencies_ms;
  for (std::size_t i = kWarmUp; i < stamps.size(); ++i) {
    const auto found = published.find(stamps[i]);
    if (found != published.end()) latencies_ms.push_back((found->second - stamps[i]).toSec() * 1e3);
  }
  if (latencies_ms.empty()) return 1;
  std::sort(latencies_ms.begin(), latencies_ms.end());
  std::printf(
      "{\"objects\": %d, \"mapped_objects\": %zu, \"beams\": %d, \"rate_hz\": %g, \"scans\": %d, \"maps\": %zu, "
      "\"p50_ms\": %.3f, \"p90_ms\": %.3f, \"p99_ms\": %.3f, \"max_ms\": %.3f, \"cpu_per_scan_ms\": %.3f}\n",
      objects, maps.objects(), kBeams, rate_hz, scans, latencies_ms.size(), quantile(latencies_ms, 0.5),
      quantile(latencies_ms, 0.9), quantile(latencies_ms, 0.99), latencies_ms.back(), cpu_per_scan_ms);
  std::fflush(stdout);
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  ros::init(argc, argv, "nodelet_path");
  if (argc != 4) {
    std::fprintf(stderr, "usage: nodelet_path OBJECTS RATE_HZ SCANS\n");
    return 2;
  }
  nodelet::Loader loader;
  ros::AsyncSpinner spinner(1);  // of the services that load nodelets
  spinner.start();
  const int result = situation_awareness::run(std::stoi(argv[1]), std::stod(argv[2]), std::stoi(argv[3]));
  ros::shutdown();  // before the loader ends, as in the program nodelet
  return result;
}
