// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/reflector_evidence.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace situation_awareness {
namespace {

/// "max_radius_m 0.1": the parameter that refuses runs of bright beams for a reason.
std::string parameter_of(const std::string& reason, const ReflectorDetectionParams& params) {
  const auto text = [](const char* name, double value) {
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), "reflectors/%s %g", name, value);
    return std::string(text.data());
  };
  if (reason == "dim") return text("min_peak_intensity", params.min_peak_intensity);
  if (reason == "far") return text("max_range_m", params.max_range_m);
  if (reason == "near") return text("min_range_m", params.min_range_m);
  if (reason == "wide") return text("max_radius_m", params.max_radius_m);
  if (reason == "narrow") return text("min_radius_m", params.min_radius_m);
  if (reason == "flush") return text("flush_step_m", params.flush_step_m);
  return "at the end of the field of view";
}

}  // namespace

void ReflectorEvidence::add(const Points& points, const ReflectorSightings& sightings) {
  states_.add(points);
  for (const Point& point : points.points) {
    if (!is_hit(point.state) || std::isnan(point.intensity)) continue;
    brightest_ = beams_ == 0 ? point.intensity : std::max(brightest_, point.intensity);
    dimmest_ = beams_ == 0 ? point.intensity : std::min(dimmest_, point.intensity);
    ++beams_;
  }
  most_sightings_ = std::max(most_sightings_, sightings.sightings.size());
  for (const auto& [reason, count] : sightings.refused) refused_[reason] += count;
}

void ReflectorEvidence::clear() {
  states_ = {};
  beams_ = 0;
  most_sightings_ = 0;
  refused_.reset();
}

std::string ReflectorEvidence::why_none() const {
  if (most_sightings_ > 0) return "";
  const std::string no_hit = states_.why_no_hit();
  if (!no_hit.empty() || states_.scans() == 0) return no_hit;
  if (beams_ == 0) return "the scans have no intensities, by which reflectors are told from other things";
  std::array<char, 160> text{};
  const auto brightest = static_cast<double>(brightest_), dimmest = static_cast<double>(dimmest_);
  if (brightest < params_.min_intensity) {
    std::snprintf(text.data(), text.size(), "the brightest beam is %g, below reflectors/min_intensity %g", brightest,
                  params_.min_intensity);
    return text.data();
  }
  if (brightest < params_.min_peak_intensity) {
    std::snprintf(text.data(), text.size(), "the brightest beam is %g, below reflectors/min_peak_intensity %g",
                  brightest, params_.min_peak_intensity);
    return text.data();
  }
  const auto most = std::max_element(refused_.begin(), refused_.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  std::snprintf(text.data(), text.size(), "the intensities are %g to %g, and reflectors/min_intensity is %g", dimmest,
                brightest, params_.min_intensity);
  if (most == refused_.end()) return "no beams are bright side by side: " + std::string(text.data());
  return "no run of bright beams is a reflector: " + std::to_string(most->second) + " are " + most->first + " (" +
         parameter_of(most->first, params_) + "); " + text.data();
}

}  // namespace situation_awareness
