// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/steady_timer.h>
#include <ros/time.h>
#include <boost/make_shared.hpp>
#include <boost/shared_ptr.hpp>

#include "situation_awareness/ros/backlog.hpp"
#include "situation_awareness/ros/master_watch.hpp"
#include "situation_awareness/ros/params/live_params.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"
#include "situation_awareness/ros/timed_subscriber.hpp"

namespace situation_awareness {

/// The nodelet's facilities for a stage, independent of its input: diagnostics, live parameters, timers, services. A
/// stage requests them in its constructor. They start after its construction, since callbacks on the queue of `node`
/// may run on another thread during onInit(), and end before its destruction. In between all calls are on that queue,
/// one at a time, without a lock.
class StageContextBase {
 public:
  StageContextBase(ros::NodeHandle& node, const ros::NodeHandle& private_node, const std::string& name);
  StageContextBase(const StageContextBase&) = delete;
  StageContextBase& operator=(const StageContextBase&) = delete;

  ros::NodeHandle& node() { return node_; }
  ros::NodeHandle& private_node() { return private_node_; }
  const std::string& name() const { return name_; }
  StageDiagnostics& diagnostics() { return diagnostics_; }

  /// Counts a message that is not used, and warns; false, for process() to return.
  bool drop(const std::string& reason, const std::string& detail = "") {
    diagnostics_.dropped(reason, detail);
    return false;
  }

  /// Calls `act` after construction of the stage, before its first message, on the callback queue: to subscribe or
  /// advertise services. Exceptions of `act` are logged.
  void when_made(std::function<void()> act) { when_made_.push_back(std::move(act)); }

  /// Calls `act` periodically, by the steady clock. `act` must not throw.
  void every(double period_s, std::function<void()> act);

  /// Returns a function that calls `act`, and again every 5 ms, by the steady clock, until it returns false: for what
  /// waits. `act` must not throw.
  std::function<void()> poll(std::function<bool()> act);

  /// Makes the live fields of `yaml` changeable while the stage runs: LiveParams.
  template <class Use, class... Params>
  void serve_live(Use use, const Params&... yaml) {
    const auto live = std::make_shared<LiveParams<Params...>>(private_node_, name_, yaml..., use);
    live_ = live;
    when_made([&live = *live] { live.serve(); });
  }

 protected:
  ~StageContextBase() = default;

  /// Called after construction of the stage.
  void begin_calls();

  /// Ends all requested calls.
  void end_calls();

 private:
  /// Calls that repeat while something waits: a timer that runs always takes three changes of threads each time.
  struct Poll {
    std::function<bool()> act;
    ros::SteadyTimer timer;
    bool runs = false;
  };

  void begin();

  ros::NodeHandle node_, private_node_;
  std::string name_;
  MasterWatch master_;
  StageDiagnostics diagnostics_;
  std::vector<std::function<void()>> when_made_;
  std::shared_ptr<void> live_;
  ros::SteadyTimer begin_;
  bool has_begun_ = false;
  std::vector<ros::SteadyTimer> timers_;
  std::deque<Poll> polls_;  ///< keeps their addresses
};

/// The same with the input: its subscription, the backlog before it, and the latency of the message being processed.
/// `Queued` is the element of the backlog: the message itself or, for a stage that adds data first (a scan's poses), a
/// struct with its `header`. `Subscriber` is as TimedSubscriber.
template <class Input, class Queued = Input, class Subscriber = TimedSubscriber<Input>>
class StageContext : public StageContextBase {
 public:
  using ConstPtr = boost::shared_ptr<const Input>;
  using QueuedConstPtr = boost::shared_ptr<const Queued>;
  using Arrived = std::function<void(const ConstPtr&, const ros::SteadyTime& arrival)>;
  using Process = std::function<bool(const Queued&)>;

  StageContext(ros::NodeHandle& node, const ros::NodeHandle& private_node, const std::string& name)
      : StageContextBase(node, private_node, name),
        backlog_(node, diagnostics(),
                 [this](const QueuedConstPtr& queued, const ros::SteadyTime& at) { handle(queued, at); }) {}

  /// For a stage whose messages also wait for other data, and where `Queued` is not the message: `act` gets each
  /// message on arrival and later drops or enqueues it; `waiting`: number of messages that it holds.
  void on_arrival(Arrived act, std::function<std::size_t()> waiting) {
    arrived_ = std::move(act);
    waiting_before_ = std::move(waiting);
  }

  /// Adds the message to the backlog.
  void enqueue(const QueuedConstPtr& queued, const ros::SteadyTime& arrival) { backlog_.add(queued, arrival); }

  /// Processes the message now, before those in the backlog: for messages that were waited for, of which none may be
  /// dropped under overload.
  void handle_now(const QueuedConstPtr& queued, const ros::SteadyTime& arrival) { handle(queued, arrival); }

  /// For a stage to which each message matters and costs little, as samples to be integrated do: under overload none is
  /// dropped.
  void keep_all() { backlog_.keep_all(); }

  void drop_enqueued(const char* reason) { backlog_.drop_all(reason); }

  /// Publishes by pointer, without serialisation between stages of one process. A message with a field
  /// `latency` gets that of the message being processed.
  template <class Output>
  void publish(const ros::Publisher& publisher, Output&& output) const {
    const auto msg = boost::make_shared<std::decay_t<Output>>(std::forward<Output>(output));
    set_latency(*msg, latency_s(), 0);
    publisher.publish(msg);
  }

  /// Called after construction of the stage; `process` as in StageNodelet.
  void start(const std::string& topic, Process process) {
    process_ = std::move(process);
    when_made([this, topic] {
      subscriber_.emplace(node(), topic, [this](const ConstPtr& msg, const ros::SteadyTime& at) { take(msg, at); });
      diagnostics().watch(subscriber_->subscriber(),
                          [this] { return backlog_.waiting() + (waiting_before_ ? waiting_before_() : 0); });
    });
    begin_calls();
  }

  /// Called before destruction of the stage: none of its functions is called any more.
  void stop() {
    end_calls();
    subscriber_.reset();
    backlog_.clear();
  }

 private:
  void take(const ConstPtr& msg, const ros::SteadyTime& arrival) {
    diagnostics().received();
    if constexpr (std::is_same_v<Input, Queued>) {
      if (!arrived_) return enqueue(msg, arrival);
    }
    try {
      arrived_(msg, arrival);
    } catch (const std::exception& error) {
      drop(drop_reason::kError, error.what());
    }
  }

  void handle(const QueuedConstPtr& queued, const ros::SteadyTime& arrival) {
    const ros::SteadyTime start = ros::SteadyTime::now();
    arrival_ = arrival;
    latency_before_s_ = latency_of(*queued, 0);
    try {
      if (process_(*queued)) diagnostics().processed(queued->header.stamp, start, latency_s());
    } catch (const std::exception& error) {
      drop(drop_reason::kError, error.what());
    }
  }

  /// Time since the scan of the message being processed arrived at the first stage, by the steady clock.
  double latency_s() const { return latency_before_s_ + (ros::SteadyTime::now() - arrival_).toSec(); }

  /// Messages from other publishers may have any value; impossible ones count as zero.
  template <class M>
  static auto latency_of(const M& msg, int) -> decltype(double(msg.latency)) {
    return msg.latency > 0.0 && std::isfinite(msg.latency) ? msg.latency : 0.0;
  }
  template <class M>
  static double latency_of(const M& /*msg*/, long) {
    return 0.0;
  }

  template <class M>
  static auto set_latency(M& msg, double latency_s, int) -> decltype(void(msg.latency = latency_s)) {
    msg.latency = latency_s;
  }
  template <class M>
  static void set_latency(M& /*msg*/, double /*latency_s*/, long) {}

  Backlog<Queued> backlog_;
  Process process_;
  Arrived arrived_;
  std::function<std::size_t()> waiting_before_;
  ros::SteadyTime arrival_;
  double latency_before_s_ = 0.0;
  std::optional<Subscriber> subscriber_;
};

}  // namespace situation_awareness
