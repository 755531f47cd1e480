// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/stage_diagnostics.hpp"

#include <algorithm>
#include <cmath>
#include <exception>

#include <ros/console.h>

#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

const ros::WallDuration kReportPeriod(1.0);
const ros::WallDuration kWarningPeriod(5.0);
constexpr double kMaxLatencyMs =
    60e3;  ///< beyond a minute the stamps are of another clock: a bag played without --clock

using diagnostic_msgs::DiagnosticStatus;

double quantile(std::vector<double>& values, double part) {
  if (values.empty()) return 0.0;
  const auto index = static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + index, values.end());
  return values[static_cast<std::size_t>(index)];
}

}  // namespace

StageDiagnostics::StageDiagnostics(ros::NodeHandle node, const ros::NodeHandle& private_node, const std::string& name)
    : name_(name), reported_at_(ros::WallTime::now()), updater_(node, private_node, name) {
  updater_.setHardwareID("none");
  updater_.add("stage", [this](diagnostic_updater::DiagnosticStatusWrapper& status) { report(status); });
  timer_ = node.createWallTimer(kReportPeriod, [this](const ros::WallTimerEvent&) {
    try {
      updater_.force_update();
    } catch (const std::exception& error) {
      dropped("diagnostics", error.what());
    }
  });
}

void StageDiagnostics::dropped(const std::string& reason, const std::string& detail) {
  const std::uint64_t count = ++dropped_[reason];
  ros::WallTime& warned_at = warned_at_[reason];
  const ros::WallTime now = ros::WallTime::now();
  if (!warned_at.isZero() && now - warned_at < kWarningPeriod) return;
  warned_at = now;
  ROS_WARN_STREAM(name_ << ": dropped, " << reason << (detail.empty() ? "" : " (" + detail + ")") << "; " << count
                        << " so far");
}

void StageDiagnostics::counted(const Counters& counters) {
  for (const auto& [reason, count] : counters) counted_[reason] += count;
}

void StageDiagnostics::processed(const ros::Time& stamp, const ros::WallTime& start) {
  ++processed_;
  // In integers: ros::Duration throws where stamps are more than 68 years apart.
  const std::int64_t latency_ns = to_nanoseconds(ros::Time::now()) - to_nanoseconds(stamp);
  const double latency_ms = static_cast<double>(latency_ns) * 1e-6;
  if (std::abs(latency_ms) <= kMaxLatencyMs) latencies_ms_.push_back(latency_ms);
  durations_ms_.push_back((ros::WallTime::now() - start).toSec() * 1e3);
}

void StageDiagnostics::report(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const ros::WallTime now = ros::WallTime::now();
  const double elapsed_s = std::max((now - reported_at_).toSec(), 1e-3);
  std::uint64_t dropped = 0;
  for (const auto& [reason, count] : dropped_) dropped += count;
  const std::uint64_t new_received = received_ - reported_received_;
  const std::uint64_t new_processed = processed_ - reported_processed_;
  const std::uint64_t new_dropped = dropped - reported_dropped_;

  if (paused_) {
    status.summary(DiagnosticStatus::WARN, "paused");
  } else if (received_ == 0) {
    status.summary(DiagnosticStatus::WARN, "no input yet");
  } else if (new_received == 0 && new_processed == 0) {
    status.summary(DiagnosticStatus::WARN, "no input");
  } else if (new_processed == 0 && new_dropped > 0) {
    status.summary(DiagnosticStatus::ERROR, "all input dropped");
  } else if (new_dropped > 0) {
    status.summary(DiagnosticStatus::WARN, "input dropped");
  } else {
    status.summary(DiagnosticStatus::OK, "running");
  }
  status.add("received", received_);
  status.add("processed", processed_);
  status.addf("rate [Hz]", "%.1f", static_cast<double>(new_processed) / elapsed_s);
  if (latencies_ms_.empty() && new_processed > 0) {
    status.add("latency", "unknown: the stamps are of another clock");
  } else {
    status.addf("latency p50 [ms]", "%.2f", quantile(latencies_ms_, 0.5));
    status.addf("latency p99 [ms]", "%.2f", quantile(latencies_ms_, 0.99));
  }
  status.addf("processing p50 [ms]", "%.2f", quantile(durations_ms_, 0.5));
  status.addf("processing p99 [ms]", "%.2f", quantile(durations_ms_, 0.99));
  for (const auto& [reason, count] : dropped_) status.add("dropped: " + reason, count);
  for (const auto& [reason, count] : counted_) status.add(reason, count);

  reported_at_ = now;
  reported_received_ = received_;
  reported_processed_ = processed_;
  reported_dropped_ = dropped;
  latencies_ms_.clear();
  durations_ms_.clear();
}

}  // namespace situation_awareness
