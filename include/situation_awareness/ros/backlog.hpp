// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <utility>

#include <ros/callback_queue_interface.h>
#include <ros/node_handle.h>
#include <ros/time.h>
#include <boost/make_shared.hpp>
#include <boost/shared_ptr.hpp>

#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/pace.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"

namespace situation_awareness {

/// Messages that wait for a stage. They are handled one at a time and in order; under overload (see Pace) some are
/// dropped and counted. A message to an idle stage is handled at once. Otherwise the next one is handled in a separate
/// callback at the end of the node handle's callback queue, so that all messages that have arrived are enqueued first.
/// All calls are on that queue, without a lock; `diagnostics` must outlive it, and `handle` must not throw.
template <typename M>
class Backlog {
 public:
  using ConstPtr = boost::shared_ptr<const M>;
  using Handler = std::function<void(const ConstPtr&, const ros::SteadyTime& arrival)>;

  Backlog(ros::NodeHandle& node, StageDiagnostics& diagnostics, Handler handle)
      : queue_(*node.getCallbackQueue()), diagnostics_(diagnostics), handle_(std::move(handle)) {}
  Backlog(const Backlog&) = delete;
  Backlog& operator=(const Backlog&) = delete;
  ~Backlog() { clear(); }

  /// `arrival`: see TimedSubscriber.
  void add(const ConstPtr& msg, const ros::SteadyTime& arrival) {
    waiting_.push_back({msg, arrival});
    if (waiting_.size() == 1 && !scheduled_ && arrival > free_since_) {
      process_next();
    } else {
      schedule_next();
    }
  }

  std::size_t waiting() const { return waiting_.size(); }

  /// From now on no message is dropped under overload.
  void keep_all() { keeps_all_ = true; }

  /// Removes all waiting messages.
  void clear() {
    queue_.removeByID(id());
    waiting_.clear();
    scheduled_ = false;
  }

  void drop_all(const char* reason) { drop_oldest(waiting_.size(), reason); }

 private:
  struct Waiting {
    ConstPtr msg;
    ros::SteadyTime arrival;
  };

  struct Turn : ros::CallbackInterface {
    explicit Turn(Backlog& backlog) : backlog(backlog) {}
    CallResult call() override {
      backlog.process_next();
      return Success;
    }
    Backlog& backlog;
  };

  std::uint64_t id() const { return reinterpret_cast<std::uint64_t>(this); }

  void schedule_next() {
    if (scheduled_) return;
    scheduled_ = true;
    queue_.addCallback(boost::make_shared<Turn>(*this), id());
  }

  void process_next() {
    scheduled_ = false;
    if (waiting_.empty()) return;
    if (!keeps_all_) {
      drop_oldest(pace_.passed_over(waiting_.size(), to_nanoseconds(waiting_.front().msg->header.stamp),
                                    to_nanoseconds(waiting_.back().msg->header.stamp)),
                  drop_reason::kOvertaken);
    }
    const Waiting next = waiting_.front();
    waiting_.pop_front();
    const ros::SteadyTime start = ros::SteadyTime::now();
    handle_(next.msg, next.arrival);
    free_since_ = ros::SteadyTime::now();
    pace_.handled((free_since_ - start).toSec());
    if (!waiting_.empty()) schedule_next();
  }

  void drop_oldest(std::size_t count, const char* reason) {
    for (; count > 0; --count, waiting_.pop_front()) diagnostics_.dropped(reason);
  }

  ros::CallbackQueueInterface& queue_;
  StageDiagnostics& diagnostics_;
  Handler handle_;
  std::deque<Waiting> waiting_;
  Pace pace_;
  ros::SteadyTime free_since_;
  bool scheduled_ = false;  ///< a callback is queued
  bool keeps_all_ = false;
};

}  // namespace situation_awareness
