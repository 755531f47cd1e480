// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/map_services.hpp"

#include <cstdio>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness::detail {
namespace {

/// Predictions are very uncertain long before that.
constexpr double kMaxPrediction_s = 60.0;

std::string seconds_text(double seconds) {
  char text[40];
  std::snprintf(text, sizeof text, "%.3f s", seconds);
  return text;
}

}  // namespace

void check_predictable(std::int64_t latest_ns, std::int64_t stamp_ns) {
  const double later_s = seconds_between(latest_ns, stamp_ns);
  if (later_s < 0.0) {
    throw std::runtime_error("the stamp is " + seconds_text(-later_s) + " before the map's latest update");
  }
  if (later_s > kMaxPrediction_s) {
    throw std::runtime_error("the stamp is " + seconds_text(later_s) + " after the map's latest update, more than " +
                             seconds_text(kMaxPrediction_s));
  }
}

}  // namespace situation_awareness::detail
