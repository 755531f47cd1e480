// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <iterator>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include <ros/time.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2/buffer_core.h>
#include <Eigen/Geometry>

#include "situation_awareness/common/in_order.hpp"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/scan_check.hpp"

namespace situation_awareness {

/// At this time all waits end, for any timeout.
constexpr std::int64_t kEndOfTime_ns = std::numeric_limits<std::int64_t>::max();

struct TransformQueueParams {
  std::string world_frame;
  double timeout_s = 0.5;        ///< how long a measurement waits for its transforms
  std::size_t max_waiting = 20;  ///< measurements; beyond it, the newest replaces the previous one
  double pose_offset_s = 0.0;   ///< from a measurement's times to those of its poses; positive ones are waited for, too
  std::string base_frame = {};  ///< its pose at the first instant is waited for, too; empty: none is
};

/// A measurement with the poses of its sensor.
template <class Item>
struct Posed {
  Item item;
  Eigen::Isometry3d T_world_sensor;      ///< of its first instant, the stamp
  Eigen::Isometry3d T_world_sensor_end;  ///< of its last instant
  double waited_s = 0.0;                 ///< for its transforms
  bool begins_anew = false;              ///< the first after a restart of time
};

/// Time and frame of a measurement.
struct Taken {
  std::string frame;  ///< its name for tf2
  ros::Time first, last;
};

/// Of a scan: at its first beam and, if it is deskewed, at its last.
Taken taken(const sensor_msgs::LaserScan& msg, bool deskew = true);

/// The same, later by so much.
Taken later(const Taken& taken, double offset_s);

/// Length of a TF buffer for measurements that wait so long: older transforms are not needed, and lookups cost its
/// length.
ros::Duration transform_cache_time(double timeout_s);

/// Whether tf2 has the poses of the frame in the world at both instants. A frame has its pose in itself without TF.
bool has_transforms(const tf2::BufferCore& transforms, const std::string& world_frame, const Taken& taken);

/// The reason why not: "from world to lidar: TF does not connect world with lidar, it has no frame world", or what tf2
/// says of the times.
std::string missing_transform(const tf2::BufferCore& transforms, const std::string& world_frame, const Taken& taken);

/// The pose of the frame in the world, to the last digit whatever transforms of later times are there. Throws as tf2
/// and isometry_from_msg.
Eigen::Isometry3d transform_at(const tf2::BufferCore& transforms, const std::string& world_frame,
                               const std::string& frame, const ros::Time& time);

/// Where a sensor is on its base, as `tf` knows it now, from then on in `poses` between frames named so there. Returns
/// an empty text, or why it is not known.
std::string mount(const tf2::BufferCore& tf, const std::string& base_frame, const std::string& sensor_frame,
                  tf2::BufferCore& poses, const std::string& base_name, const std::string& sensor_name);

/// Measurements of one sensor (scans, clouds, images) that wait in order for the transforms of their first and last
/// instant. Nodelets and offline tools share it: it decides which are used and which are dropped. One whose stamp is
/// far from those around it is held until others agree with it (InOrder).
///
/// The clock is the caller's and must be monotonic: live a steady clock, offline the time of the recording. Transforms
/// may come on another thread, calls must not. Nothing is thrown; `on_drop` is called for each drop with one of the
/// reasons of drop_reason.
template <class Item>
class TransformQueue {
 public:
  using OnDrop = std::function<void(const char* reason, const std::string& detail)>;

  /// `transforms` must outlive this; it is cleared on a restart of time. Throws std::invalid_argument naming field
  /// and bound.
  TransformQueue(tf2::BufferCore& transforms, TransformQueueParams params, OnDrop on_drop)
      : transforms_(transforms), params_(std::move(params)), on_drop_(std::move(on_drop)) {
    if (params_.world_frame.empty()) throw std::invalid_argument("world_frame is empty");
    if (!(params_.timeout_s >= 0.0)) throw std::invalid_argument("timeout_s is not a number >= 0");
    if (!std::isfinite(params_.pose_offset_s)) throw std::invalid_argument("pose_offset_s is not finite");
    if (params_.max_waiting == 0) throw std::invalid_argument("max_waiting is 0, it must be 1 at least");
  }

  /// Adds a measurement, received now. On kRestart all earlier ones are dropped but those that were held, on kRefused
  /// this one is, or it is held.
  StampOrder::Verdict add(Item item, const Taken& taken, std::int64_t now_ns) {
    return add(std::move(item), taken, now_ns, now_ns);
  }

  /// The same with its receipt by another clock, StampOrder::kNone if it is not known.
  StampOrder::Verdict add(Item item, const Taken& taken, std::int64_t now_ns, std::int64_t received_ns) {
    return in_order_.add(
        Waiting{std::move(item), later(taken, params_.pose_offset_s), now_ns}, to_nanoseconds(taken.first), received_ns,
        now_ns, [this](Waiting one, StampOrder::Verdict verdict) { wait(std::move(one), verdict); },
        [this](bool was_held) { drop(was_held); });
  }

  /// Passes on measurements that were held and that this receipt explains.
  void receive(std::int64_t now_ns, std::int64_t received_ns) {
    in_order_.release(received_ns, now_ns,
                      [this](Waiting one, StampOrder::Verdict verdict) { wait(std::move(one), verdict); });
  }

  /// The next measurement with its transforms, in order; to be called until there is none. Drops those whose transforms
  /// will not come, and those beyond the bound.
  std::optional<Posed<Item>> next(std::int64_t now_ns) {
    if (now_ns == kEndOfTime_ns) in_order_.end([this](bool was_held) { drop(was_held); });
    while (!waiting_.empty()) {
      // Transforms come in order: if a later measurement has them, those of an earlier one will not come. They
      // come at any time, on another thread, so the later one is checked first.
      const bool overtaken = waiting_.size() > 1 && has_transforms(waiting_.back().posed);
      Waiting& oldest = waiting_.front();
      const double waited_s = seconds_between(oldest.since_ns, now_ns);
      if (has_transforms(oldest.posed)) {
        const Waiting ready = std::move(oldest);
        waiting_.pop_front();
        try {
          return Posed<Item>{ready.item, pose_at(ready.posed, ready.posed.first),
                             pose_at(ready.posed, ready.posed.last), waited_s, std::exchange(begins_anew_, false)};
        } catch (const std::exception& error) {
          on_drop_(drop_reason::kBadTransform, error.what());
        }
      } else if (overtaken || waited_s >= params_.timeout_s + std::max(params_.pose_offset_s, 0.0)) {
        on_drop_(drop_reason::kNoTransform, missing(oldest.posed));
        waiting_.pop_front();
      } else {
        break;
      }
    }
    while (waiting_.size() > params_.max_waiting) {
      // Not the oldest: where transforms are later than the queue is long, its transforms come next.
      waiting_.erase(std::prev(waiting_.end(), 2));
      on_drop_(drop_reason::kQueueFull, "");
    }
    return std::nullopt;
  }

  std::size_t waiting() const { return waiting_.size(); }
  /// Whether no measurement waits for transforms or is held.
  bool is_empty() const { return waiting_.empty() && in_order_.held() == 0; }

 private:
  struct Waiting {
    Item item;
    Taken posed;  ///< the times of its poses
    std::int64_t since_ns;
  };

  void wait(Waiting one, StampOrder::Verdict verdict) {
    if (verdict == StampOrder::Verdict::kRestart) {
      for (; !waiting_.empty(); waiting_.pop_front()) on_drop_(drop_reason::kRestart, "");
      transforms_.clear();  // those of another time would block new ones
      begins_anew_ = true;
    }
    waiting_.push_back(std::move(one));
  }
  void drop(bool was_held) { on_drop_(was_held ? drop_reason::kAnotherTime : drop_reason::kStamp, ""); }

  bool has_transforms(const Taken& taken) const {
    const std::string& world = params_.world_frame;
    return situation_awareness::has_transforms(transforms_, world, taken) &&
           (params_.base_frame.empty() || situation_awareness::has_transforms(transforms_, world, base(taken)));
  }
  std::string missing(const Taken& taken) const {
    const std::string& world = params_.world_frame;
    const bool is_base = situation_awareness::has_transforms(transforms_, world, taken);
    return missing_transform(transforms_, world, is_base ? base(taken) : taken);
  }
  Taken base(const Taken& taken) const { return {params_.base_frame, taken.first, taken.first}; }
  Eigen::Isometry3d pose_at(const Taken& taken, const ros::Time& time) const {
    return transform_at(transforms_, params_.world_frame, taken.frame, time);
  }

  tf2::BufferCore& transforms_;
  TransformQueueParams params_;
  InOrder<Waiting> in_order_;
  OnDrop on_drop_;
  std::deque<Waiting> waiting_;
  bool begins_anew_ = false;  ///< and none was released since
};

}  // namespace situation_awareness
