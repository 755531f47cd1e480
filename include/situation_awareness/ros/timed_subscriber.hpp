// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>

#include <ros/callback_queue_interface.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <ros/time.h>
#include <boost/make_shared.hpp>
#include <boost/shared_ptr.hpp>

namespace situation_awareness {

/// Forwards callbacks to another queue, each with its arrival time by the steady clock. roscpp's receipt time is in ROS
/// time, which may stop and jump when simulated. The other queue calls one at a time.
class ArrivalQueue : public ros::CallbackQueueInterface {
 public:
  explicit ArrivalQueue(ros::CallbackQueueInterface& queue) : queue_(queue) {}

  void addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t owner_id = 0) override {
    queue_.addCallback(boost::make_shared<Timed>(*this, callback), owner_id);
  }

  void removeByID(std::uint64_t owner_id) override { queue_.removeByID(owner_id); }

  /// Arrival time of the current callback.
  const ros::SteadyTime& arrival() const { return arrival_; }

 private:
  struct Timed : ros::CallbackInterface {
    Timed(ArrivalQueue& queue, ros::CallbackInterfacePtr callback) : queue(queue), callback(std::move(callback)) {}
    CallResult call() override {
      queue.arrival_ = arrival;
      return callback->call();
    }
    bool ready() override { return callback->ready(); }

    ArrivalQueue& queue;
    ros::CallbackInterfacePtr callback;
    ros::SteadyTime arrival = ros::SteadyTime::now();
  };

  ros::CallbackQueueInterface& queue_;
  ros::SteadyTime arrival_;
};

/// A subscription with the arrival time of each message by the steady clock, live and simulated: when the publisher in
/// the same process, or the connection, delivered it, not when it is processed. Its queue is unbounded, since drops
/// would not be counted; it holds only messages that arrive while one is processed.
///
/// Each message is taken once: where one thread subscribes while another advertises the topic, roscpp may connect the
/// two twice within the process, and then delivers every shared message twice.
template <typename M>
class TimedSubscriber {
 public:
  using ConstPtr = boost::shared_ptr<const M>;

  /// `take` is called on the callback queue of `node` and must not throw.
  TimedSubscriber(ros::NodeHandle& node, const std::string& topic,
                  std::function<void(const ConstPtr&, const ros::SteadyTime&)> take)
      : queue_(*node.getCallbackQueue()) {
    const std::uint32_t no_bound = 0;
    auto options = ros::SubscribeOptions::create<M>(
        topic, no_bound,
        [this, take = std::move(take)](const ConstPtr& msg) {
          if (std::exchange(latest_, msg) != msg) take(msg, queue_.arrival());
        },
        ros::VoidConstPtr(), &queue_);
    options.transport_hints = ros::TransportHints().tcpNoDelay();
    subscriber_ = node.subscribe(options);
  }

  const ros::Subscriber& subscriber() const { return subscriber_; }

 private:
  ArrivalQueue queue_;
  ConstPtr latest_;
  ros::Subscriber subscriber_;  ///< ends before its queue
};

}  // namespace situation_awareness
