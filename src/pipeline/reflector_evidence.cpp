// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/reflector_evidence.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "situation_awareness/common/format.hpp"

namespace situation_awareness {
namespace {

/// "max_radius_m 0.1": the parameter that refuses runs of bright beams for a reason.
std::string parameter_of(const std::string& reason, const ReflectorDetectionParams& params) {
  const auto text = [](const char* name, double value) { return formatted("reflectors/%s %g", name, value); };
  if (reason == "dim") return text("min_peak_intensity", params.min_peak_intensity);
  if (reason == "far") return text("max_range_m", params.max_range_m);
  if (reason == "near") return text("min_range_m", params.min_range_m);
  if (reason == "wide") return text("max_radius_m", params.max_radius_m);
  if (reason == "narrow") return text("min_radius_m", params.min_radius_m);
  if (reason == "flush") return text("flush_step_m", params.flush_step_m);
  return "at the end of the field of view";
}

/// A gap is so many empty classes wide at least, a factor of 1.5, with so many beams above it at least, and this part
/// of all at most: reflectors are rods. A class is empty with less than this part of what is above.
constexpr std::size_t kMinGapClasses = 5;
constexpr std::size_t kMaxGapClasses = 32;  // where the others are 0
constexpr std::uint64_t kMinBrightBeams = 20;
constexpr double kMaxBrightPart = 0.2;
constexpr double kEmptyPart = 0.02;
constexpr int kMantissaBits = 20;  // of a float that are no part of its class

/// The least intensity of a class.
double lower_edge(std::size_t index) {
  const auto bits = static_cast<std::uint32_t>(index << kMantissaBits);
  float value = 0.0F;
  std::memcpy(&value, &bits, sizeof value);
  return static_cast<double>(value);
}

double with_two_digits(double value) {
  const double step = std::pow(10.0, std::floor(std::log10(value)) - 1.0);
  return std::round(value / step) * step;
}

}  // namespace

std::size_t IntensityHistogram::class_of(float intensity) {
  if (!(intensity > 0.0F)) return 0;
  std::uint32_t bits = 0;
  std::memcpy(&bits, &intensity, sizeof bits);
  return std::min<std::size_t>(bits >> kMantissaBits, kClasses - 1);
}

std::optional<IntensityHistogram::Groups> IntensityHistogram::groups() const {
  const std::uint64_t all = std::accumulate(counts_.begin(), counts_.end(), std::uint64_t{0});
  const auto most_bright = static_cast<std::uint64_t>(kMaxBrightPart * static_cast<double>(all));
  std::uint64_t above = 0, within = 0;
  std::size_t top = kClasses;  // of the gap that is looked at: the class above it
  std::size_t widest = 0, begin = 0, end = 0;
  for (std::size_t i = kClasses; i-- > 0 && above <= most_bright;) {
    const bool is_empty = static_cast<double>(within + counts_[i]) <= kEmptyPart * static_cast<double>(above);
    if (above >= kMinBrightBeams && is_empty) {
      within += counts_[i];
      continue;
    }
    const std::size_t width = std::min(top - i - 1, kMaxGapClasses);
    if (above >= kMinBrightBeams && counts_[i] > 0 && width > widest) {
      widest = width;
      begin = top - width;
      end = top;
    }
    above += within + counts_[i];
    within = 0;
    top = i;
  }
  if (widest < kMinGapClasses) return std::nullopt;
  Groups groups{lower_edge(begin), lower_edge(end), 0.0};
  groups.between = with_two_digits(std::sqrt(groups.lower_to * groups.upper_from));
  return groups;
}

void ReflectorEvidence::add(const Points& points, const ReflectorSightings& sightings) {
  states_.add(points);
  for (const Point& point : points.points) {
    if (!is_hit(point.state) || std::isnan(point.intensity)) continue;
    brightest_ = beams_ == 0 ? point.intensity : std::max(brightest_, point.intensity);
    dimmest_ = beams_ == 0 ? point.intensity : std::min(dimmest_, point.intensity);
    intensities_.add(point.intensity);
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
  intensities_.clear();
}

/// "; the intensities are in two groups, ..."; empty where they are not, or the threshold is between them.
std::string ReflectorEvidence::proposal() const {
  const auto groups = intensities_.groups();
  if (!groups) return "";
  const bool is_between = params_.min_intensity >= groups->lower_to && params_.min_peak_intensity <= groups->upper_from;
  if (is_between) return "";
  return formatted(
      "; the intensities are in two groups, up to %.3g and from %.3g on: set reflectors/min_intensity and "
      "reflectors/min_peak_intensity to %g",
      groups->lower_to, groups->upper_from, groups->between);
}

std::string ReflectorEvidence::why_none() const {
  if (most_sightings_ > 0) return "";
  const std::string no_hit = states_.why_no_hit();
  if (!no_hit.empty() || states_.scans() == 0) return no_hit;
  if (beams_ == 0) return "the scans have no intensities, by which reflectors are told from other things";
  const auto brightest = static_cast<double>(brightest_), dimmest = static_cast<double>(dimmest_);
  if (brightest < params_.min_intensity) {
    return formatted("the brightest beam is %g, below reflectors/min_intensity %g", brightest, params_.min_intensity) +
           proposal();
  }
  if (brightest < params_.min_peak_intensity) {
    return formatted("the brightest beam is %g, below reflectors/min_peak_intensity %g", brightest,
                     params_.min_peak_intensity) +
           proposal();
  }
  const auto most = std::max_element(refused_.begin(), refused_.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  const std::string intensities = formatted("the intensities are %g to %g, and reflectors/min_intensity is %g", dimmest,
                                            brightest, params_.min_intensity);
  if (most == refused_.end()) return "no beams are bright side by side: " + intensities + proposal();
  return "no run of bright beams is a reflector: " + std::to_string(most->second) + " are " + most->first + " (" +
         parameter_of(most->first, params_) + "); " + intensities + proposal();
}

}  // namespace situation_awareness
