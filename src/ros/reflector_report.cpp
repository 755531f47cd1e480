// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/reflector_report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <ros/console.h>

namespace situation_awareness {
namespace {

using diagnostic_msgs::DiagnosticStatus;

/// m. Beyond this standard deviation of the position a lack of reflectors is a warning.
constexpr double kUncertain_m = 0.1;

std::string place_text(const Eigen::Vector2d& p_m) {
  char text[64];
  std::snprintf(text, sizeof text, "(%.2f, %.2f)", p_m.x(), p_m.y());
  return text;
}

std::string reflector_text(const ReflectorMap& map, int reflector) {
  return "reflectors[" + std::to_string(reflector) + "] at " +
         place_text(map.reflectors[static_cast<std::size_t>(reflector)].center_world_m);
}

}  // namespace

std::string missing_sentence(const ReflectorMap& map, int reflector) {
  return reflector_text(map, reflector) + " is missing: beams pass through its place";
}

std::string moved_sentence(const ReflectorMap& map, const MovedReflector& moved) {
  const Eigen::Vector2d& known_m = map.reflectors[static_cast<std::size_t>(moved.reflector)].center_world_m;
  char distance[32];
  std::snprintf(distance, sizeof distance, "%.2f m", (moved.center_world_m - known_m).norm());
  return reflector_text(map, moved.reflector) + " stands " + distance + " from there, at " +
         place_text(moved.center_world_m);
}

std::string too_few_sentence(const ReflectorCoverage& coverage, double sigma_m) {
  char text[128];
  std::snprintf(text, sizeof text, "fewer than %zu reflectors for %.1f s: the position is known to %.2f m",
                ReflectorCoverage::kNeeded, coverage.too_few_now_s, sigma_m);
  return text;
}

void ReflectorReport::add(const ReflectorUpdate& update) {
  if (update.is_known) log_changes(update);
  latest_ = update;
  has_update_ = true;
}

void ReflectorReport::log_changes(const ReflectorUpdate& update) {
  std::set<int> missing(update.missing.begin(), update.missing.end()), moved;
  for (const MovedReflector& of : update.moved) {
    moved.insert(of.reflector);
    if (moved_.count(of.reflector) == 0) {
      ROS_WARN_STREAM(name_ << ": " << moved_sentence(localization_.map(), of));
    }
  }
  for (const int reflector : missing) {
    if (missing_.count(reflector) == 0) {
      ROS_WARN_STREAM(name_ << ": " << missing_sentence(localization_.map(), reflector));
    }
  }
  for (const std::set<int>* before : {&missing_, &moved_}) {
    for (const int reflector : *before) {
      if (missing.count(reflector) + moved.count(reflector) > 0) continue;
      ROS_INFO_STREAM(name_ << ": " << reflector_text(localization_.map(), reflector) << " is in its place again");
    }
  }
  missing_ = std::move(missing);
  moved_ = std::move(moved);
}

void ReflectorReport::report(StageDiagnostics::Status& status) {
  const bool is_known = localization_.is_known();
  if (!has_update_) {
    status.add("pose", "not known: no scan yet");
  } else if (!is_known) {
    status.add("pose", "not known: " + std::string(latest_.reason));
    const std::string why = pipeline_.why_unknown();
    if (!why.empty()) status.mergeSummary(DiagnosticStatus::WARN, why);
  } else {
    status.add("pose", "known");
  }
  if (is_known) {
    const Eigen::Matrix3d P = localization_.pose().covariance_world;
    status.addf("sigma x [m]", "%.4f", std::sqrt(P(0, 0)));
    status.addf("sigma y [m]", "%.4f", std::sqrt(P(1, 1)));
    status.addf("sigma yaw [rad]", "%.4f", std::sqrt(P(2, 2)));
  }
  const ReflectorCoverage& coverage = localization_.coverage();
  status.addf("too few reflectors [s]", "%.1f", coverage.too_few_s);
  status.addf("too few reflectors now [s]", "%.1f", coverage.too_few_now_s);
  status.addf("too few reflectors at a stretch [s]", "%.1f", coverage.longest_s);
  status.addf("largest sigma [m]", "%.4f", coverage.largest_sigma_m);
  status.add("reflectors", localization_.map().reflectors.size());
  status.add("matched", latest_.matches.size());
  status.add("ambiguous", latest_.ambiguous.size());
  status.add("unmatched", latest_.unmatched.size());
  status.add("missing", latest_.missing.size());
  status.add("moved", latest_.moved.size());
  for (const auto& [reason, count] : localization_.counters()) status.add(reason, count);
  for (const MovedReflector& moved : latest_.moved) {
    status.mergeSummary(DiagnosticStatus::WARN, moved_sentence(localization_.map(), moved));
  }
  for (const int reflector : latest_.missing) {
    status.mergeSummary(DiagnosticStatus::WARN, missing_sentence(localization_.map(), reflector));
  }
  if (is_known && coverage.too_few_now_s > 0.0) {
    const Eigen::Matrix3d P = localization_.pose().covariance_world;
    const double sigma_m = std::sqrt(std::max(P(0, 0), P(1, 1)));
    if (sigma_m > kUncertain_m) status.mergeSummary(DiagnosticStatus::WARN, too_few_sentence(coverage, sigma_m));
  }
  if (is_known && latest_.is_contradicted) {
    status.mergeSummary(DiagnosticStatus::WARN, "the reflectors contradict the pose");
  }
}

}  // namespace situation_awareness
