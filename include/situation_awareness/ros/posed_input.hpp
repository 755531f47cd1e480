// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <exception>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include <ros/steady_timer.h>
#include <ros/time.h>
#include <ros/transport_hints.h>
#include <std_msgs/Header.h>
#include <tf2_ros/buffer.h>
#include <Eigen/Geometry>
#include <boost/make_shared.hpp>
#include <boost/shared_ptr.hpp>

#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"
#include "situation_awareness/ros/receipt.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/stage_context.hpp"
#include "situation_awareness/ros/timed_subscriber.hpp"
#include "situation_awareness/ros/transform_age.hpp"
#include "situation_awareness/ros/transform_input.hpp"
#include "situation_awareness/ros/transform_queue.hpp"

namespace situation_awareness {

/// A measurement of a sensor with the poses of the sensor of its first and its last instant.
template <class Message>
struct PosedMessage {
  std_msgs::Header header;
  boost::shared_ptr<const Message> msg;
  Eigen::Isometry3d T_world_sensor, T_world_sensor_end;
};

/// The input of a stage with measurements of a sensor (scans, clouds, images) that need the sensor's poses: each waits
/// for its transforms, then in the backlog. Drops are counted by reason, delays of transforms are on /diagnostics. All
/// calls are on the callback queue of its stage, without a lock; `context` must outlive it. `Queued`: what the stage
/// takes, made of a PosedMessage. `Subscriber`: as of StageContext.
template <class Message, class Queued = PosedMessage<Message>, class Subscriber = TimedSubscriber<Message>>
class PosedInput {
 public:
  using Context = StageContext<Message, Queued, Subscriber>;
  using ConstPtr = boost::shared_ptr<const Message>;

  struct Use {
    std::function<std::string(const Message&)> defect;     ///< reason to drop it at once; empty if it is valid
    std::function<Taken(const Message&)> taken;            ///< its time and frame
    std::function<void()> restarted;                       ///< called after a restart of stamps
    std::function<ConstPtr(const ConstPtr&)> before = {};  ///< called first; what it returns is used in its place
  };

  /// `pose_offset_s` later than a measurement is its pose.
  PosedInput(Context& context, const NodeletParams& params, double pose_offset_s, Use use)
      : context_(context),
        use_(std::move(use)),
        max_stamp_ahead_s_(params.max_stamp_ahead_s),
        tf_(transform_cache_time(params.tf_timeout_s)),
        transform_age_(tf_, params.world_frame),
        queue_(tf_,
               {params.world_frame, params.tf_timeout_s, static_cast<std::size_t>(params.queue_size), pose_offset_s},
               [this](const char* reason, const std::string& detail) { context_.drop(reason, detail); }),
        transform_input_(tf_, context.node(), [this] { on_transforms(); }) {
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { transform_age_.report(status); });
    context.on_arrival([this](const ConstPtr& msg, const ros::SteadyTime& arrival) { take(msg, arrival); },
                       [this] { return queue_.waiting(); });
    // A measurement may wait in vain.
    context.when_made([this] {
      const bool oneshot = false, autostart = false;
      timer_ = context_.node().createSteadyTimer(
          ros::WallDuration(kLookAgain_s), [this](const ros::SteadyTimerEvent&) { look_again(); }, oneshot, autostart);
    });
  }
  PosedInput(const PosedInput&) = delete;
  PosedInput& operator=(const PosedInput&) = delete;

 private:
  /// So much later than its time a measurement may be dropped; transforms release it when they come.
  static constexpr double kLookAgain_s = 0.05;

  struct Arrived {
    ConstPtr msg;
    ros::SteadyTime at;
  };

  struct Turn : ros::CallbackInterface {
    explicit Turn(PosedInput& input) : input(input) {}
    CallResult call() override {
      input.is_queued_ = false;
      input.release();
      return Success;
    }
    PosedInput& input;
  };

  void take(const ConstPtr& arrived, const ros::SteadyTime& arrival) {
    const ConstPtr msg = use_.before ? use_.before(arrived) : arrived;
    const std::string defect = use_.defect(*msg);
    if (!defect.empty()) return context_.diagnostics().dropped(defect);
    const Taken taken = use_.taken(*msg);
    if (is_ahead_of_clock(taken.first, max_stamp_ahead_s_)) {
      context_.drop(drop_reason::kAheadOfClock);
      return;
    }
    const StampOrder::Verdict verdict = queue_.add({msg, arrival}, taken, steady_now_ns(), receipt_ns());
    if (verdict == StampOrder::Verdict::kRestart) {
      context_.drop_enqueued(drop_reason::kRestart);
      use_.restarted();
    }
    if (verdict != StampOrder::Verdict::kRefused) transform_age_.scan_arrived(taken.frame);
    waits_ = true;
    release();
    if (waits_ && !std::exchange(looks_again_, true)) timer_.start();
  }

  /// On any thread.
  void on_transforms() {
    if (!waits_ || is_queued_.exchange(true)) return;
    context_.node().getCallbackQueue()->addCallback(boost::make_shared<Turn>(*this));
  }

  void look_again() {
    release();
    if (waits_) return;
    timer_.stop();
    looks_again_ = false;
  }

  /// Enqueues the measurements that have their transforms. Does not throw.
  void release() {
    try {
      queue_.receive(steady_now_ns(), receipt_ns());
      while (const std::optional<Posed<Arrived>> ready = queue_.next(steady_now_ns())) {
        transform_age_.scan_waited(ready->waited_s);
        const ConstPtr& msg = ready->item.msg;
        const PosedMessage<Message> posed{msg->header, msg, ready->T_world_sensor, ready->T_world_sensor_end};
        context_.enqueue(boost::make_shared<const Queued>(posed), ready->item.at);
      }
    } catch (const std::exception& error) {
      context_.drop(drop_reason::kError, error.what());
    }
    waits_ = !queue_.is_empty();
  }

  Context& context_;
  Use use_;
  double max_stamp_ahead_s_;
  tf2_ros::Buffer tf_;
  TransformAge transform_age_;
  TransformQueue<Arrived> queue_;
  ros::SteadyTimer timer_;
  bool looks_again_ = false;            ///< the timer runs
  std::atomic<bool> waits_{false};      ///< a measurement waits for transforms or is held
  std::atomic<bool> is_queued_{false};  ///< a call of release()
  TransformInput transform_input_;
};

}  // namespace situation_awareness
