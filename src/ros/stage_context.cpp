// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/stage_context.hpp"

#include <utility>

#include <ros/console.h>

namespace situation_awareness {
namespace {

const ros::WallDuration kPollPeriod(0.005);

}  // namespace

StageContextBase::StageContextBase(ros::NodeHandle& node, const ros::NodeHandle& private_node, const std::string& name)
    : node_(node), private_node_(private_node), name_(name), master_(private_node), diagnostics_(name) {
  diagnostics_.on_report([this](StageDiagnostics::Status& status) { master_.report(status); });
}

void StageContextBase::every(double period_s, std::function<void()> act) {
  when_made([this, period_s, act = std::move(act)] {
    timers_.push_back(
        node_.createSteadyTimer(ros::WallDuration(period_s), [act](const ros::SteadyTimerEvent&) { act(); }));
  });
}

std::function<void()> StageContextBase::poll(std::function<bool()> act) {
  Poll& poll = polls_.emplace_back();
  poll.act = std::move(act);
  when_made([this, &poll] {
    const bool oneshot = false, autostart = false;
    poll.timer = node_.createSteadyTimer(
        kPollPeriod,
        [&poll](const ros::SteadyTimerEvent&) {
          if (poll.act()) return;
          poll.timer.stop();
          poll.runs = false;
        },
        oneshot, autostart);
  });
  return [&poll] {
    if (poll.act() && !std::exchange(poll.runs, true)) poll.timer.start();
  };
}

void StageContextBase::begin_calls() {
  // By a timer, and so on the callback queue, not concurrently with other callbacks.
  const bool oneshot = false, autostart = false;  // it may fire before it is assigned
  begin_ = node_.createSteadyTimer(
      ros::WallDuration(1e-3), [this](const ros::SteadyTimerEvent&) { begin(); }, oneshot, autostart);
  begin_.start();
}

void StageContextBase::begin() {
  begin_.stop();
  // Under load the timer has expired again before its first callback runs, and then there is a second one.
  if (std::exchange(has_begun_, true)) return;
  diagnostics_.start(node_, private_node_);
  for (const auto& act : when_made_) {
    try {
      act();
    } catch (const std::exception& error) {
      ROS_ERROR_STREAM(name_ << ": " << error.what());
    }
  }
}

void StageContextBase::end_calls() {
  begin_.stop();
  for (ros::SteadyTimer& timer : timers_) timer.stop();
  for (Poll& poll : polls_) poll.timer.stop();
  live_.reset();
  diagnostics_.stop();
}

}  // namespace situation_awareness
