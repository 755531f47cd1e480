// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <exception>

#include <nodelet/nodelet.h>
#include <ros/time.h>

namespace situation_awareness {

/// A nodelet that refuses to start with one sentence where `start` throws; its manager and the others live on.
class StageNodelet : public nodelet::Nodelet {
 protected:
  /// Since a scan came to the first stage, by the steady clock: `before_s`, as the message that came at `arrival` says,
  /// and what it took since. What others publish may say anything; what cannot be counts as nothing.
  static double latency_s(double before_s, const ros::SteadyTime& arrival) {
    const double here_s = (ros::SteadyTime::now() - arrival).toSec();
    return before_s > 0.0 && std::isfinite(before_s) ? before_s + here_s : here_s;
  }

 private:
  virtual void start() = 0;

  void onInit() final {
    try {
      start();
    } catch (const std::exception& error) {
      NODELET_FATAL_STREAM(getName() << " does not start: " << error.what());
      throw;  // the manager drops this nodelet
    }
  }
};

}  // namespace situation_awareness
