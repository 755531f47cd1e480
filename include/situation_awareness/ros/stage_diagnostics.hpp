// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/node_handle.h>
#include <ros/steady_timer.h>
#include <ros/subscriber.h>
#include <ros/time.h>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/params.hpp"

namespace situation_awareness {

/// Times in milliseconds since the last report.
class Samples {
 public:
  /// Ages beyond a minute are ignored: the stamps are of another clock (a bag played without --clock).
  static constexpr double kMost_ms = 60e3;

  void add(double value_ms) { values_ms_.push_back(value_ms); }
  bool empty() const { return values_ms_.empty(); }

  /// Adds "NAME p50 [ms]" and "NAME p99 [ms]", 0 without values; then clears them.
  void report(const std::string& name, diagnostic_updater::DiagnosticStatusWrapper& status);

 private:
  std::vector<double> values_ms_;
};

/// Status of one nodelet on /diagnostics, once a second by the steady clock: input, output, drops by reason, and times.
/// All calls are on the callback queue of its node handle, without a lock.
class StageDiagnostics {
 public:
  using Status = diagnostic_updater::DiagnosticStatusWrapper;

  /// `name`: of the nodelet.
  explicit StageDiagnostics(const std::string& name);

  /// Starts reports, after construction of the stage; a stage that cannot start only logs.
  void start(ros::NodeHandle node, const ros::NodeHandle& private_node);

  /// Ends the calls of on_report().
  void stop() { timer_.stop(); }

  /// The input's subscription, and the number of waiting messages. `subscriber` must outlive this.
  void watch(const ros::Subscriber& subscriber, std::function<std::size_t()> waiting);

  /// Called at each report, in the order of registration, to add the stage's own values.
  void on_report(std::function<void(Status&)> add) { adds_.push_back(std::move(add)); }

  /// Warns now, once per text, and shows it in every report.
  void unknown_parameters(const std::vector<UnknownKey>& keys);

  void received() { ++received_; }

  /// Counts, and warns at most every few seconds per reason; `detail` is only for the warning and the summary.
  void dropped(const std::string& reason, const std::string& detail = "");

  /// Adds counts that are no faults (deleted elements, refused segments).
  void counted(const Counters& counters);

  /// Whether input is ignored on purpose.
  void pause(bool paused) { paused_ = paused; }

  /// Output for the input of `stamp` was published; processing began at `start`, and `latency_s` is the time since its
  /// scan arrived at the first stage, both by the steady clock.
  void processed(const ros::Time& stamp, const ros::SteadyTime& start, double latency_s);

 private:
  struct Drops {
    std::uint64_t count = 0;
    std::uint64_t reported = 0;
    std::string detail;  ///< of the latest
    ros::SteadyTime warned_at;
  };

  void summarise(std::uint64_t new_received, std::uint64_t new_processed, Status& status) const;
  std::string missing_input() const;
  void report(Status& status);

  std::string name_;
  bool paused_ = false;
  const ros::Subscriber* subscriber_ = nullptr;
  std::function<std::size_t()> waiting_;
  std::vector<std::function<void(Status&)>> adds_;
  std::vector<UnknownKey> unknown_;
  std::uint64_t received_ = 0;
  std::uint64_t processed_ = 0;
  std::map<std::string, Drops> drops_;
  Counters counted_;
  std::uint64_t reported_received_ = 0;
  std::uint64_t reported_processed_ = 0;
  ros::SteadyTime reported_at_;
  Samples latencies_;
  Samples ages_;
  Samples durations_;
  std::optional<diagnostic_updater::Updater> updater_;
  ros::SteadyTimer timer_;
};

}  // namespace situation_awareness
