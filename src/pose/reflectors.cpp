// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pose/reflectors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// rad. Standard deviation of the azimuth at which a beam meets a reflector; makes ranges on its flanks uncertain.
constexpr double kPointingSigma_rad = 0.0005;
/// Most beams in a row without a return within a reflector.
constexpr int kMaxMissingOnReflector = 1;
/// m. Greatest difference in range between neighbouring beams of one reflector; single beams, which may be mixed,
/// excepted.
constexpr double kMaxRangeGap_m = 0.2;
/// m. A side of a reflector is hidden if the return beside it is nearer by more than this.
constexpr double kOcclusionMargin_m = 0.1;
/// Least part of the width of a reflector, about its middle, that is bright; its flanks return less light.
constexpr double kMinBrightPart = 0.8;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Points of the integral over the azimuth, and of that over the half width that is bright. With twice as many the
/// results change by less than a hundredth of their standard deviations.
constexpr int kAzimuths = 24;
constexpr int kWidths = 6;
/// A range farther than this from the others' median, in standard deviations, is of a mixed beam.
constexpr double kMaxOffset_sigma = 4.0;
/// Most hits that a fit uses the ranges of, evenly spread; there are more only on a reflector very near by.
constexpr std::size_t kMaxFitHits = 64;
/// Least share of the ranges in the information about an azimuth: keeps what is new with each scan positive definite.
constexpr double kMinShare = 1e-4;
/// Steps of the azimuth: the width from which on of two bright beams one at least is entirely on a reflector. Depends
/// on the width of a beam, which is half a step or less.
constexpr double kTwoBeams = 1.5;
/// Beams beside a run that are looked at to tell whether it is flush.
constexpr int kBeside = 3;

double half_width_rad(double radius_m, double range_m) { return std::asin(std::min(1.0, radius_m / range_m)); }

/// Points of a scan from one that is not bright on, so that no run crosses the end of a full circle.
class Ring {
 public:
  Ring(const Points& points, double min_intensity) : points_(points), min_intensity_(min_intensity) {
    if (!points.full_circle) return;
    const auto dark = std::find_if(points.points.begin(), points.points.end(),
                                   [&](const Point& p) { return is_hit(p.state) && !is_bright(p); });
    if (dark != points.points.end()) start_ = static_cast<std::size_t>(dark - points.points.begin());
  }

  int size() const { return static_cast<int>(points_.points.size()); }
  bool has(int k) const { return points_.full_circle || (k >= 0 && k < size()); }
  const Point& at(int k) const { return points_.points[index(k)]; }
  double azimuth_rad(int k) const {
    const double turns = std::floor((static_cast<double>(start_) + k) / size());
    return at(k).azimuth_rad + 2.0 * kPi * turns;
  }
  bool is_bright(const Point& point) const { return is_hit(point.state) && point.intensity >= min_intensity_; }
  bool is_bright_at(int k) const { return is_bright(at(k)); }

 private:
  std::size_t index(int k) const {
    const int n = size();
    return static_cast<std::size_t>(((static_cast<int>(start_) + k) % n + n) % n);
  }

  const Points& points_;
  double min_intensity_;
  std::size_t start_ = 0;
};

/// Of [begin, end) of the hits. Of an even number the lower, since mixed ranges are mostly too long.
double median_range(const std::vector<ReflectorHit>& hits, std::size_t first, std::size_t count) {
  std::array<double, kMaxFitHits> ranges{};
  const std::size_t used = std::min(count, kMaxFitHits);
  for (std::size_t i = 0; i < used; ++i) ranges[i] = hits[first + i * count / used].range_m;
  const auto middle = ranges.begin() + static_cast<std::ptrdiff_t>((used - 1) / 2);
  std::nth_element(ranges.begin(), middle, ranges.begin() + static_cast<std::ptrdiff_t>(used));
  return *middle;
}

/// Beams beside a run, in the direction `step` from its end `k`.
struct Side {
  double free_rad = 0.0;  ///< see ReflectorSighting::free_after_rad
  double step_m = 0.0;    ///< to the return beside it, 0 if there is none
  bool is_cut = false;
  bool is_flush = false;
};

Side side_of(const Ring& ring, int k, int step, double range_m, double resolution_rad,
             const ReflectorDetectionParams& params) {
  Side side;
  int missing = 0;
  int beside = k + step;
  while (ring.has(beside) && !is_hit(ring.at(beside).state) && missing <= kMaxMissingOnReflector) {
    ++missing;
    beside += step;
  }
  if (!ring.has(k + step)) {
    side.is_cut = true;
    return side;
  }
  // Few beams without a return may have been lost on the reflector; many are free space beside it.
  const bool some_lost = missing > 0 && missing <= kMaxMissingOnReflector;
  side.free_rad = (1 + (some_lost ? missing : 0)) * resolution_rad;
  if (!ring.has(beside) || !is_hit(ring.at(beside).state)) return side;
  side.step_m = std::abs(ring.at(beside).range_m - range_m);
  if (ring.at(beside).range_m < range_m - kOcclusionMargin_m) side.free_rad = kInfinity;
  side.is_flush = params.flush_step_m > 0.0;
  for (int i = 0, m = beside; i < kBeside && side.is_flush; ++i, m += step) {
    if (!ring.has(m)) break;
    const Point& point = ring.at(m);
    side.is_flush = is_hit(point.state) && std::abs(point.range_m - range_m) < params.flush_step_m;
  }
  return side;
}

/// Adds the run of bright beams from `begin` to `end`, both on it, or counts why it is none.
void add_run(const Points& points, const Ring& ring, int begin, int end, const ReflectorDetectionParams& params,
             ReflectorSightings& result) {
  ReflectorSighting sighting;
  sighting.first = result.hits.size();
  for (int k = begin; k <= end; ++k) {
    if (!ring.is_bright_at(k)) continue;
    result.hits.push_back({ring.azimuth_rad(k), ring.at(k).range_m});
    sighting.peak_intensity = std::max(sighting.peak_intensity, ring.at(k).intensity);
  }
  sighting.count = result.hits.size() - sighting.first;
  const double range_m = median_range(result.hits, sighting.first, sighting.count);
  const double resolution_rad = points.resolution_rad;
  const Side before = side_of(ring, begin, -1, range_m, resolution_rad, params);
  const Side after = side_of(ring, end, 1, range_m, resolution_rad, params);
  const double span_rad = ring.azimuth_rad(end) - ring.azimuth_rad(begin);
  const double widest_rad =
      2.0 * half_width_rad(params.max_radius_m, range_m + params.max_radius_m) + params.fit.beam_width_rad;
  const double narrowest_rad =
      2.0 * kMinBrightPart * half_width_rad(params.min_radius_m, range_m + params.min_radius_m);
  const auto defect = [&]() -> const char* {
    if (before.is_cut || after.is_cut) return "cut";
    if (sighting.peak_intensity < params.min_peak_intensity) return "dim";
    if (range_m > params.max_range_m) return "far";
    if (range_m < params.min_range_m) return "near";
    if (span_rad > widest_rad) return "wide";
    if (span_rad + before.free_rad + after.free_rad < narrowest_rad) return "narrow";
    if (before.is_flush && after.is_flush) return "flush";
    return nullptr;
  }();
  if (defect != nullptr) {
    ++result.refused[defect];
    result.hits.resize(sighting.first);
    return;
  }
  sighting.azimuth_rad = ring.azimuth_rad(begin) + 0.5 * span_rad;
  sighting.surface_range_m = range_m;
  sighting.free_before_rad = before.free_rad;
  sighting.free_after_rad = after.free_rad;
  sighting.step_m = std::max(before.step_m, after.step_m);
  sighting.time_offset_s = points.time_increment_s * 0.5 * (ring.at(begin).beam + ring.at(end).beam);
  if (std::abs(ring.at(begin).beam - ring.at(end).beam) > ring.size() / 2) {
    // The run lies across the end of a full circle, and its ends are a sweep apart.
    sighting.time_offset_s = points.time_increment_s * ring.at((begin + end) / 2).beam;
  }
  const ReflectorFit fit = fit_reflector(result, sighting, params.radius_m);
  const Eigen::Vector2d along(std::cos(fit.azimuth_rad), std::sin(fit.azimuth_rad));
  sighting.center_level_m = fit.range_m * along;
  Eigen::Matrix2d J;  // d(x, y) / d(range, azimuth)
  J << along.x(), -fit.range_m * along.y(), along.y(), fit.range_m * along.x();
  sighting.covariance = J * fit.covariance * J.transpose();
  result.sightings.push_back(sighting);
}

/// Divides a run at gaps in range that have two beams or more on both sides; a single beam beside a gap is mixed.
void add_runs(const Points& points, const Ring& ring, int begin, int end, const ReflectorDetectionParams& params,
              ReflectorSightings& result) {
  int part = begin, in_part = 0, last = begin;
  for (int k = begin; k <= end; ++k) {
    if (!ring.is_bright_at(k)) continue;
    const auto gap = [&](int from, int to) {
      return std::abs(ring.at(from).range_m - ring.at(to).range_m) > kMaxRangeGap_m;
    };
    const bool goes_on = k < end && ring.is_bright_at(k + 1) && !gap(k, k + 1);
    if (in_part >= 2 && gap(last, k) && goes_on) {
      add_run(points, ring, part, last, params, result);
      part = k;
      in_part = 0;
    }
    ++in_part;
    last = k;
  }
  add_run(points, ring, part, end, params, result);
}

}  // namespace

void ReflectorFitParams::validate() const { check_bounds(*this, "reflectors.fit"); }

void ReflectorDetectionParams::validate() const {
  check_bounds(*this, "reflectors");
  const auto fail = [](const std::string& what) { throw std::invalid_argument("reflectors." + what); };
  if (min_radius_m > max_radius_m) {
    fail("min_radius_m = " + yaml_text(min_radius_m) + " is above max_radius_m = " + yaml_text(max_radius_m));
  }
  if (min_range_m > max_range_m) {
    fail("min_range_m = " + yaml_text(min_range_m) + " is above max_range_m = " + yaml_text(max_range_m));
  }
  if (min_intensity > min_peak_intensity) {
    fail("min_intensity = " + yaml_text(min_intensity) +
         " is above min_peak_intensity = " + yaml_text(min_peak_intensity));
  }
}

ReflectorSightings detect_reflectors(const Points& points, const ReflectorDetectionParams& params,
                                     ReflectorSightings memory) {
  ReflectorSightings result = std::move(memory);
  result.hits.clear();
  result.sightings.clear();
  result.refused.reset();
  result.stamp_ns = points.stamp_ns;
  result.resolution_rad = points.resolution_rad;
  result.fit = params.fit;
  result.free = free_space(points, std::move(result.free));
  result.free_begin_s = result.free_end_s = 0.0;
  if (points.points.empty()) return result;
  result.free_begin_s = points.time_increment_s * points.points.front().beam;
  result.free_end_s = points.time_increment_s * points.points.back().beam;
  result.hits.reserve(points.points.size());
  result.sightings.reserve(points.points.size() / 8);  // any scan of the same size finds room

  const Ring ring(points, params.min_intensity);
  int begin = -1, end = -1, missing = 0;
  const auto finish = [&] {
    if (begin >= 0) add_runs(points, ring, begin, end, params, result);
    begin = -1;
  };
  for (int k = 0; k < ring.size(); ++k) {
    if (ring.is_bright_at(k)) {
      if (begin < 0) begin = k;
      end = k;
      missing = 0;
    } else if (is_hit(ring.at(k).state) || ++missing > kMaxMissingOnReflector) {
      finish();
    }
  }
  finish();
  return result;
}

ReflectorFit fit_reflector(const ReflectorSightings& sightings, const ReflectorSighting& sighting, double radius_m) {
  const ReflectorFitParams& params = sightings.fit;
  const double resolution_rad = sightings.resolution_rad;
  const ReflectorHit* hits = sightings.hits.data() + sighting.first;
  const double first_rad = hits[0].azimuth_rad;
  const double last_rad = hits[sighting.count - 1].azimuth_rad;
  const double middle_rad = sighting.azimuth_rad;

  // What is bright is symmetric about the azimuth phi of the centre, phi +- w, and w is known roughly.
  const double half_rad = half_width_rad(radius_m, sighting.surface_range_m + radius_m);
  const double least_rad = kMinBrightPart * half_rad;
  const double most_rad = half_rad + 0.5 * params.beam_width_rad;
  const auto prior = [&](double phi_rad) {
    int widths = 0;
    for (int i = 0; i < kWidths; ++i) {
      const double w_rad = least_rad + (most_rad - least_rad) * i / (kWidths - 1);
      const double left_rad = phi_rad - w_rad, right_rad = phi_rad + w_rad;
      const bool fits = left_rad <= first_rad && left_rad >= first_rad - sighting.free_before_rad &&
                        right_rad >= last_rad && right_rad <= last_rad + sighting.free_after_rad;
      widths += fits ? 1 : 0;
    }
    return static_cast<double>(widths);
  };
  double low_rad = std::max(last_rad - most_rad, first_rad - sighting.free_before_rad + least_rad);
  double high_rad = std::min(first_rad + most_rad, last_rad + sighting.free_after_rad - least_rad);

  // Distance of the centre by one hit, d = r cos psi + sqrt(rho^2 - r^2 sin^2 psi), and its change with phi.
  const auto center_range = [&](const ReflectorHit& hit, double phi_rad) {
    const double across_m = hit.range_m * std::sin(hit.azimuth_rad - phi_rad);
    return hit.range_m * std::cos(hit.azimuth_rad - phi_rad) +
           std::sqrt(std::max(0.0, radius_m * radius_m - across_m * across_m));
  };
  const auto slope = [&](const ReflectorHit& hit, double phi_rad) {
    const double psi_rad = hit.azimuth_rad - phi_rad;
    const double across_m = hit.range_m * std::sin(psi_rad);
    const double inside_m = std::sqrt(std::max(0.04 * radius_m * radius_m, radius_m * radius_m - across_m * across_m));
    return across_m * (1.0 + hit.range_m * std::cos(psi_rad) / inside_m);
  };

  // Hits whose range is used, with the weight of their distance of the centre.
  struct Used {
    ReflectorHit hit;
    double weight;
    double center_m;
    double slope_m_rad;
  };
  std::array<Used, kMaxFitHits> used{};
  std::array<double, kMaxFitHits> sorted{};
  const std::size_t candidates = std::min(sighting.count, kMaxFitHits);
  for (std::size_t i = 0; i < candidates; ++i) {
    Used& u = used[i];
    u.hit = hits[i * sighting.count / candidates];
    u.slope_m_rad = slope(u.hit, middle_rad);
    u.center_m = sorted[i] = center_range(u.hit, middle_rad);
    const double flank_m = u.slope_m_rad * kPointingSigma_rad;
    u.weight = 1.0 / (params.range_sigma_m * params.range_sigma_m + flank_m * flank_m);
  }
  const auto median = sorted.begin() + static_cast<std::ptrdiff_t>((candidates - 1) / 2);
  std::nth_element(sorted.begin(), median, sorted.begin() + static_cast<std::ptrdiff_t>(candidates));
  std::size_t count = 0;
  for (std::size_t i = 0; i < candidates; ++i) {
    const double allowed_m = kMaxOffset_sigma * params.range_sigma_m +
                             std::abs(used[i].slope_m_rad) * (0.5 * resolution_rad + kPointingSigma_rad);
    if (std::abs(used[i].center_m - *median) <= allowed_m) used[count++] = used[i];
  }
  double weights = 0.0;
  for (std::size_t i = 0; i < count; ++i) weights += used[i].weight;

  ReflectorFit fit;
  std::array<double, kAzimuths> phis{}, centers_m{}, costs{}, priors{};
  const auto integrate = [&](bool with_prior) {
    double total = 0.0, least = kInfinity;
    const double step_rad = (high_rad - low_rad) / kAzimuths;
    for (std::size_t g = 0; g < kAzimuths; ++g) {
      phis[g] = low_rad + (static_cast<double>(g) + 0.5) * step_rad;
      priors[g] = with_prior ? prior(phis[g]) : 1.0;
      if (priors[g] == 0.0) continue;
      double sum = 0.0, square = 0.0;
      for (std::size_t i = 0; i < count; ++i) {
        const double d = center_range(used[i].hit, phis[g]) - *median;
        sum += used[i].weight * d;
        square += used[i].weight * d * d;
      }
      centers_m[g] = *median + sum / weights;
      costs[g] = square - sum * sum / weights;
      least = std::min(least, costs[g]);
    }
    double phi_rad = 0.0, center_m = 0.0;
    for (std::size_t g = 0; g < kAzimuths; ++g) {
      if (priors[g] == 0.0) continue;
      priors[g] *= std::exp(-0.5 * (costs[g] - least));
      total += priors[g];
      phi_rad += priors[g] * (phis[g] - middle_rad);
      center_m += priors[g] * (centers_m[g] - *median);
    }
    if (total == 0.0) return false;
    fit.azimuth_rad = middle_rad + phi_rad / total;
    fit.range_m = *median + center_m / total;
    fit.covariance.setZero();
    for (std::size_t g = 0; g < kAzimuths; ++g) {
      if (priors[g] == 0.0) continue;
      const Eigen::Vector2d d(centers_m[g] - fit.range_m, phis[g] - fit.azimuth_rad);
      fit.covariance += priors[g] / total * d * d.transpose();
    }
    fit.covariance(0, 0) += 1.0 / weights;
    fit.covariance(1, 1) += step_rad * step_rad / 12.0 + kPointingSigma_rad * kPointingSigma_rad;
    return true;
  };
  fit.is_width_plausible = high_rad > low_rad && integrate(true);
  if (!fit.is_width_plausible) {
    low_rad = middle_rad - resolution_rad;
    high_rad = middle_rad + resolution_rad;
    integrate(false);
  }

  double mean = 0.0, information = 0.0;
  for (std::size_t i = 0; i < count; ++i) mean += used[i].weight / weights * used[i].slope_m_rad;
  for (std::size_t i = 0; i < count; ++i) {
    information += used[i].weight * (used[i].slope_m_rad - mean) * (used[i].slope_m_rad - mean);
  }
  // Of the azimuth's information this share comes from the ranges. The mean of two estimates, weighted by information,
  // has from each a variance that is its share of the whole.
  const double share = std::clamp(information * fit.covariance(1, 1), kMinShare, 1.0);
  fit.white(0, 0) = 1.0 / weights;
  fit.white(1, 1) = share * fit.covariance(1, 1);
  fit.covariance(0, 1) = fit.covariance(1, 0) = std::sqrt(1.0 - share) * fit.covariance(0, 1);  // keeps the rest >= 0
  // All beams may be partly beside it. Of three the middle one is on it, and of two both where it is wide enough.
  const bool may_be_mixed = sighting.count == 1 || (sighting.count == 2 && 2.0 * half_rad < kTwoBeams * resolution_rad);
  if (may_be_mixed) {
    const double mixed_m = params.mixed_part * sighting.step_m;
    fit.covariance(0, 0) += mixed_m * mixed_m;
  }
  return fit;
}

}  // namespace situation_awareness
