// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/stage_diagnostics.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

#include <ros/console.h>

#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {
namespace {

const ros::WallDuration kReportPeriod(1.0);
const ros::WallDuration kWarningPeriod(5.0);

using diagnostic_msgs::DiagnosticStatus;

double quantile(std::vector<double>& values, double part) {
  if (values.empty()) return 0.0;
  const auto index = static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + index, values.end());
  return values[static_cast<std::size_t>(index)];
}

std::string with_detail(const std::string& reason, const std::string& detail) {
  return detail.empty() ? reason : reason + " (" + detail + ")";
}

}  // namespace

void Samples::report(const std::string& name, diagnostic_updater::DiagnosticStatusWrapper& status) {
  status.addf(name + " p50 [ms]", "%.2f", quantile(values_ms_, 0.5));
  status.addf(name + " p99 [ms]", "%.2f", quantile(values_ms_, 0.99));
  values_ms_.clear();
}

StageDiagnostics::StageDiagnostics(const std::string& name) : name_(name), reported_at_(ros::SteadyTime::now()) {}

void StageDiagnostics::start(ros::NodeHandle node, const ros::NodeHandle& private_node) {
  updater_.emplace(node, private_node, name_);
  updater_->setHardwareID("none");
  updater_->add("stage", [this](Status& status) { report(status); });
  timer_ = node.createSteadyTimer(kReportPeriod, [this](const ros::SteadyTimerEvent&) {
    try {
      updater_->force_update();
    } catch (const std::exception& error) {
      dropped("diagnostics", error.what());
    }
  });
}

void StageDiagnostics::watch(const ros::Subscriber& subscriber, std::function<std::size_t()> waiting) {
  subscriber_ = &subscriber;
  waiting_ = std::move(waiting);
}

void StageDiagnostics::unknown_parameters(const std::vector<UnknownKey>& keys) {
  unknown_ = keys;
  for (const UnknownKey& key : unknown_) ROS_WARN_STREAM(name_ << ": " << message_of(key));
}

void StageDiagnostics::dropped(const std::string& reason, const std::string& detail) {
  Drops& drops = drops_[reason];
  ++drops.count;
  drops.detail = detail;
  const ros::SteadyTime now = ros::SteadyTime::now();
  if (!drops.warned_at.isZero() && now - drops.warned_at < kWarningPeriod) return;
  drops.warned_at = now;
  ROS_WARN_STREAM(name_ << ": dropped, " << with_detail(reason, detail) << "; " << drops.count << " so far");
}

void StageDiagnostics::counted(const Counters& counters) {
  for (const auto& [reason, count] : counters) counted_[reason] += count;
}

void StageDiagnostics::processed(const ros::Time& stamp, const ros::SteadyTime& start, double latency_s) {
  ++processed_;
  latencies_.add(latency_s * 1e3);
  durations_.add((ros::SteadyTime::now() - start).toSec() * 1e3);
  // In integers: ros::Duration throws where stamps are more than 68 years apart.
  const std::int64_t age_ns = to_nanoseconds(ros::Time::now()) - to_nanoseconds(stamp);
  const double age_ms = static_cast<double>(age_ns) * 1e-6;
  if (std::abs(age_ms) <= Samples::kMost_ms) ages_.add(age_ms);
}

/// Text after "no input": nobody publishes, or the silent topic.
std::string StageDiagnostics::missing_input() const {
  if (subscriber_ == nullptr) return "";
  const std::string topic = subscriber_->getTopic();
  return subscriber_->getNumPublishers() == 0 ? ": nobody publishes " + topic : " on " + topic;
}

void StageDiagnostics::summarise(std::uint64_t new_received, std::uint64_t new_processed, Status& status) const {
  std::uint64_t most = 0;
  std::string why;
  for (const auto& [reason, drops] : drops_) {
    if (drops.count - drops.reported <= most) continue;
    most = drops.count - drops.reported;
    why = with_detail(reason, drops.detail);
  }
  if (paused_) {
    status.summary(DiagnosticStatus::WARN, "paused");
  } else if (received_ == 0) {
    status.summary(DiagnosticStatus::WARN, "no input yet" + missing_input());
  } else if (new_received == 0 && new_processed == 0 && most == 0) {
    status.summary(DiagnosticStatus::WARN, "no input" + missing_input());
  } else if (new_processed == 0 && most > 0) {
    status.summary(DiagnosticStatus::ERROR, "all input dropped: " + why);
  } else if (most > 0) {
    status.summary(DiagnosticStatus::WARN, "input dropped: " + why);
  } else {
    status.summary(DiagnosticStatus::OK, "running");
  }
  for (const UnknownKey& key : unknown_) status.mergeSummary(DiagnosticStatus::WARN, "unknown parameter " + key.path);
}

void StageDiagnostics::report(Status& status) {
  const ros::SteadyTime now = ros::SteadyTime::now();
  const double elapsed_s = std::max((now - reported_at_).toSec(), 1e-3);
  const std::uint64_t new_received = received_ - reported_received_;
  const std::uint64_t new_processed = processed_ - reported_processed_;

  summarise(new_received, new_processed, status);
  status.add("received", received_);
  status.add("processed", processed_);
  if (waiting_) status.add("waiting", waiting_());
  status.addf("input rate [Hz]", "%.1f", static_cast<double>(new_received) / elapsed_s);
  status.addf("rate [Hz]", "%.1f", static_cast<double>(new_processed) / elapsed_s);
  latencies_.report("latency", status);
  durations_.report("processing", status);
  if (ages_.empty() && new_processed > 0) {
    status.add("age", "unknown: the stamps are of another clock");
  } else {
    ages_.report("age", status);
  }
  for (const auto& add : adds_) add(status);
  for (auto& [reason, drops] : drops_) {
    status.add("dropped: " + reason, drops.count);
    drops.reported = drops.count;
  }
  for (const auto& [reason, count] : counted_) status.add(reason, count);
  for (const UnknownKey& key : unknown_) status.add("unknown parameter " + key.path, message_of(key));

  reported_at_ = now;
  reported_received_ = received_;
  reported_processed_ = processed_;
}

}  // namespace situation_awareness
