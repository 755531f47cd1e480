// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/check/scans.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/common/format.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/scan_check.hpp"

namespace situation_awareness {
namespace {

/// A scanner does not see farther than this: larger numbers are of another unit.
constexpr double kLargestRange_m = 500.0;
/// A range of this times range_max is none that stands for "nothing there".
constexpr float kBeyondMax = 1.5F;
/// The time of all beams may be longer than the period by this.
constexpr double kLongestSweep = 1.05;
/// So many of the beams say something.
constexpr double kMany = 0.01;

}  // namespace

void ScanTopicCheck::look(const sensor_msgs::LaserScan& msg) {
  const std::string defect = scan_msg_defect(msg);
  if (!defect.empty()) {
    ++defects_[defect];
    return;
  }
  if (good_ == 0) {
    first_ = msg;
    fewest_beams_ = most_beams_ = msg.ranges.size();
  }
  ++good_;
  fewest_beams_ = std::min(fewest_beams_, msg.ranges.size());
  most_beams_ = std::max(most_beams_, msg.ranges.size());
  beams_ += msg.ranges.size();
  convention_.add_ranges(msg.ranges, msg.range_max);
  for (const float range_m : msg.ranges) {
    if (std::isnan(range_m)) {
      ++nan_;
    } else if (std::isinf(range_m)) {
      ++(range_m > 0.0F ? infinite_ : too_close_);
    } else if (range_m == 0.0F) {
      ++zero_;
    } else if (range_m >= msg.range_max) {
      ++at_max_;
      if (range_m > kBeyondMax * msg.range_max) ++beyond_max_;
      largest_m_ = std::max(largest_m_, static_cast<double>(range_m));
    } else {
      ++hits_;
      largest_m_ = std::max(largest_m_, static_cast<double>(range_m));
    }
  }
  for (const float intensity : msg.intensities) {
    if (!std::isfinite(intensity)) continue;
    dimmest_ = intensities_ == 0 ? intensity : std::min(dimmest_, intensity);
    brightest_ = intensities_ == 0 ? intensity : std::max(brightest_, intensity);
    ++intensities_;
  }
}

void ScanTopicCheck::add_to(TopicReport& report) const {
  add_defects(defects_, stamps_.count(), "scans", "mend the driver's message", report);
  if (good_ == 0) return;
  const double increment_deg = degrees(first_.angle_increment);
  std::string line = fewest_beams_ == most_beams_ ? formatted("%zu beams", most_beams_)
                                                  : formatted("%zu to %zu beams", fewest_beams_, most_beams_);
  line += formatted(", each %.4g deg %s, from %.1f deg on; %.3g to %.4g m", std::abs(increment_deg),
                    increment_deg > 0.0 ? "to the left of the one before" : "to the right of the one before",
                    degrees(first_.angle_min), static_cast<double>(first_.range_min),
                    static_cast<double>(first_.range_max));
  report.facts.push_back(line);

  const auto part = [this](std::size_t count) {
    return 1e2 * static_cast<double>(count) / static_cast<double>(beams_);
  };
  line = formatted("%.1f %% of the beams have a return", part(hits_));
  const auto others = [&](std::size_t count, const char* what) {
    if (count > 0) line += formatted(", %.2g %% are %s", part(count), what);
  };
  others(infinite_, "inf");
  others(at_max_, "range_max or more");
  others(nan_, "NaN");
  others(zero_, "zero");
  others(too_close_, "-inf");
  report.facts.push_back(line);
  if (intensities_ > 0) {
    report.facts.push_back(
        formatted("intensities from %g to %g", static_cast<double>(dimmest_), static_cast<double>(brightest_)));
  } else {
    report.facts.emplace_back("no intensities: reflectors cannot be told from other things");
  }
  add_times(report);

  const std::string advice = convention_.no_return_advice();
  if (!advice.empty()) {
    report.findings.push_back(
        {advice, "in a copy of cfg/map.yaml, with --config: what has gone leaves the map sooner"});
  }
  if (part(beyond_max_) > 1e2 * kMany || largest_m_ > kLargestRange_m) {
    report.findings.push_back({formatted("ranges of up to %.4g m, and range_max is %.4g m", largest_m_,
                                         static_cast<double>(first_.range_max)),
                               "let the driver send both in m: what is beyond range_max is no hit"});
  }
  if (hits_ == 0) report.findings.push_back({"no beam has a return", "look at the driver's ranges and range_max"});
}

void ScanTopicCheck::add_times(TopicReport& report) const {
  const double sweep_s = first_.time_increment * static_cast<double>(first_.ranges.size() - 1);
  if (first_.time_increment == 0.0F) {
    report.facts.emplace_back("no times of beams (time_increment 0): all are taken at the stamp");
    return;
  }
  report.facts.push_back(
      formatted("%.3g us from beam to beam, %.1f ms for all", 1e6 * first_.time_increment, 1e3 * sweep_s));
  const double period_s = stamps_.period_s();
  if (usable_time_increment_s(first_) == 0.0) {
    report.findings.push_back({formatted("time_increment is %g s", static_cast<double>(first_.time_increment)),
                               "it is not used, and all beams are taken at the stamp: let the driver send s"});
  } else if (period_s > 0.0 && sweep_s > kLongestSweep * period_s) {
    report.findings.push_back({formatted("all beams take %.1f ms by time_increment, but a scan comes each %.1f ms",
                                         1e3 * sweep_s, 1e3 * period_s),
                               "mend time_increment in the driver, or set deskew: false"});
  }
}

}  // namespace situation_awareness
