// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/scan_view.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

/// Beams beside the nearest ones that are searched for a hit near a place, at least and at most.
constexpr double kFewestBeside = 4.0, kMostBeside = 16.0;
/// Standard deviations of a hit's and an element's place along the beam; beams that end so far behind have passed it.
constexpr double kPassedSigmas = 3.0;
/// m. The least such distance: boundaries are not as smooth as a line.
constexpr double kLeastPassed_m = 0.03;
/// Cosine between a beam and the normal of an element that it can be said to have passed, from either side.
constexpr double kFacesBeam = 0.25;
/// Part of an element's extent through which a beam can pass: at its ends it may be curved, or end.
constexpr double kInner = 0.7;
/// m. The same of an element of few hits.
constexpr double kLeastHalfHeld_m = 0.006;
/// m. A hit so near beside an element, and so little nearer or farther, is of the same thing; and the same of an
/// element with many hits: beams over an edge have few.
constexpr double kBeside_m = 0.03;
constexpr double kBesideKnown_m = 0.055;
constexpr int kManyHits = 60;
/// m. What has a hit so near was not passed by the beams beside it: the boundary may be a little elsewhere.
constexpr double kNearHit_m = 0.06;
/// m. The same at grazing incidence, where beams that pass before a surface seem to go through it.
constexpr double kNearHitGrazing_m = 0.12;
/// m. How far behind such a surface beams have to pass: half of the way between them, at least and at most.
constexpr double kLeastWithin_m = 0.02, kMostWithin_m = 0.035;
/// m. Beams are about as wide as they are apart: where that is more, one that meets the edge of a thing may end behind
/// it, and counts less.
constexpr double kCloseBeams_m = 0.045;
/// Beams that are farther apart than this part of a thing may all miss it, or meet its edges only.
constexpr double kSurePart = 0.5;

/// rad. Of an element, seen from the sensor: to 1e-8 where a series is enough.
double small_atan(double x) {
  if (std::abs(x) > 0.1) return std::atan(x);
  const double x2 = x * x;
  return x * (1.0 - x2 * (1.0 / 3.0 - x2 / 5.0));
}

/// The first of ascending azimuths that is_beyond() holds for; near `about_rad`. Beams are about as far apart as
/// others: where that tells which one it is, no search is needed.
template <class IsBeyond>
std::vector<float>::const_iterator first_beam(const std::vector<float>& azimuth_rad, const IsBeyond& is_beyond,
                                              double about_rad) {
  constexpr std::ptrdiff_t kMostSteps = 6;
  const auto last = static_cast<std::ptrdiff_t>(azimuth_rad.size()) - 1;
  const double first_rad = azimuth_rad.front(), turn_rad = azimuth_rad.back() - first_rad;
  if (turn_rad > 0.0) {
    const double part = std::clamp((about_rad - first_rad) / turn_rad, 0.0, 1.0);
    auto beam = azimuth_rad.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(last));
    for (std::ptrdiff_t step = 0; step < kMostSteps; ++step) {
      if (beam != azimuth_rad.end() && !is_beyond(*beam)) {
        ++beam;
      } else if (beam != azimuth_rad.begin() && is_beyond(*(beam - 1))) {
        --beam;
      } else {
        return beam;
      }
    }
  }
  return std::partition_point(azimuth_rad.begin(), azimuth_rad.end(), [&](float a) { return !is_beyond(a); });
}

/// How much beams so far apart say of a thing of this size.
double close_beams(double apart_m, double thing_m) {
  if (thing_m <= 0.0) thing_m = ScanView::kWideThing_m;  // of nothing that was shown
  const auto squared = [](double x) { return x * x; };
  return std::min(1.0, squared(kCloseBeams_m / apart_m)) *
         std::min(1.0, squared(squared(kSurePart * thing_m / apart_m)));
}

}  // namespace

void ScanView::set(std::int64_t stamp_ns, const Pose2& T_level_world, const FreeSpace& free_space) {
  stamp_ns_ = stamp_ns;
  T_level_world_ = T_level_world;
  free_space_ = free_space;
  most_m_ = 0.0;
  ends_level_m_.clear();
  for (std::size_t i = 0; i < free_space.range_m.size(); ++i) {
    const double range_m = free_space.range_m[i], azimuth_rad = free_space.azimuth_rad[i];
    ends_level_m_.emplace_back(range_m * std::cos(azimuth_rad), range_m * std::sin(azimuth_rad));
    most_m_ = std::max(most_m_, range_m);
  }
}

double ScanView::azimuth_of(const Eigen::Vector2d& p_level_m) const {
  const double first_rad = azimuth_rad().front();
  double azimuth = std::atan2(p_level_m.y(), p_level_m.x());
  while (azimuth < first_rad) azimuth += 2.0 * kPi;
  while (azimuth >= first_rad + 2.0 * kPi) azimuth -= 2.0 * kPi;
  return azimuth;
}

ScanView::Seen ScanView::see(const Eigen::Vector2d& p_level_m, double near_m, double thing_m, double margin_m,
                             double* weight) const {
  if (azimuth_rad().size() < 2) return Seen::kUnknown;
  return see_at(azimuth_of(p_level_m), p_level_m, near_m, thing_m, margin_m, weight);
}

ScanView::Seen ScanView::see_at(double place_rad, const Eigen::Vector2d& p_level_m, double near_m, double thing_m,
                                double margin_m, double* weight) const {
  const std::vector<float>&azimuth_rad = free_space_.azimuth_rad, &ranges_m = free_space_.range_m;
  const auto above = first_beam(
      azimuth_rad, [place = static_cast<float>(place_rad)](float a) { return a > place; }, place_rad);
  if (above == azimuth_rad.begin() || above == azimuth_rad.end()) return Seen::kUnknown;
  const std::ptrdiff_t left = above - azimuth_rad.begin(), right = left - 1;
  const double range_m = p_level_m.norm();
  const double apart_m = range_m * static_cast<double>(azimuth_rad[static_cast<std::size_t>(left)] -
                                                       azimuth_rad[static_cast<std::size_t>(right)]);
  const auto beside =
      static_cast<std::ptrdiff_t>(std::clamp(near_m / std::max(apart_m, 1e-6), kFewestBeside, kMostBeside));
  const auto count = static_cast<std::ptrdiff_t>(ranges_m.size());
  for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(right - beside, 0); i <= std::min(left + beside, count - 1); ++i) {
    const double own_m = ranges_m[static_cast<std::size_t>(i)];
    if (own_m <= 0.0 || std::abs(own_m - range_m) > near_m) continue;
    if ((ends_level_m_[static_cast<std::size_t>(i)] - p_level_m).squaredNorm() < near_m * near_m) return Seen::kHit;
  }
  const auto [least_m, most_m] =
      std::minmax(ranges_m[static_cast<std::size_t>(right)], ranges_m[static_cast<std::size_t>(left)]);
  if (least_m < range_m + margin_m) return Seen::kUnknown;
  *weight = close_beams(apart_m, thing_m);
  if (most_m >= most_m_) *weight *= kNoReturnWeight;
  return Seen::kPassed;
}

void LatestScanView::set(std::int64_t stamp_ns, const Pose2& T_level_world, const FreeSpace& free_space) {
  ScanView::set(stamp_ns, T_level_world, free_space);
  rays_.clear();
  for (const float azimuth_rad : free_space.azimuth_rad) {
    rays_.emplace_back(std::cos(azimuth_rad), std::sin(azimuth_rad));
  }
}

void LatestScanView::set_errors(double resolution_rad, double hit_sigma_m) {
  resolution_rad_ = resolution_rad;
  hit_sigma_m_ = hit_sigma_m;
}

double LatestScanView::passing_weight(const Surfel& surfel, const Eigen::Matrix2d& R_level_world) const {
  const Eigen::Vector2d p_level_m = R_level_world * surfel.p_world_m + T_level_world().translation_m;
  const double distance_m = p_level_m.norm();
  if (distance_m >= most_m() || distance_m <= least_m_) return 0.0;
  const Eigen::Vector2d n_level =
      surfel.oriented ? Eigen::Vector2d(R_level_world * surfel.normal_world) : Eigen::Vector2d(-p_level_m / distance_m);
  const bool grazes = std::abs(n_level.dot(p_level_m)) < kFacesBeam * distance_m;
  if (azimuth_rad().size() < 2) return 0.0;
  if (grazes) return weight_of_grazed(surfel, p_level_m, n_level);
  const double middle_rad = azimuth_of(p_level_m);
  double weight = 0.0;
  if (see_at(middle_rad, p_level_m, kNearHit_m, surfel.thing_m, margin_m_, &weight) == Seen::kPassed) return weight;
  return weight_through(surfel, p_level_m, n_level, middle_rad);
}

/// Beams before a surface seem to pass it though it stands: those behind it do not.
double LatestScanView::weight_of_grazed(const Surfel& surfel, const Eigen::Vector2d& p_level_m,
                                        const Eigen::Vector2d& n_level) const {
  const double within_m = std::clamp(0.5 * p_level_m.norm() * resolution_rad_, kLeastWithin_m, kMostWithin_m);
  const Eigen::Vector2d within_level_m = p_level_m - within_m * n_level;
  double weight = 0.0;
  const Seen seen = see(within_level_m, kNearHitGrazing_m, surfel.thing_m, margin_m_, &weight);
  return seen == Seen::kPassed ? weight : 0.0;
}

/// The weight by beams through an element that is seen at this azimuth.
double LatestScanView::weight_through(const Surfel& surfel, const Eigen::Vector2d& p_level_m,
                                      const Eigen::Vector2d& n_level, double middle_rad) const {
  const std::vector<float>& azimuths_rad = azimuth_rad();
  const double distance_m = p_level_m.norm();
  const Eigen::Vector2d t_level(n_level.y(), -n_level.x());
  double weight = 0.0;
  const double low_m = std::min(kInner * surfel.low_m, -kLeastHalfHeld_m);
  const double high_m = std::max(kInner * surfel.high_m, kLeastHalfHeld_m);
  const double across_m2 = p_level_m.x() * t_level.y() - p_level_m.y() * t_level.x(), along_m = p_level_m.dot(t_level);
  const auto azimuth_at = [&](double s_m) {
    return middle_rad + small_atan(s_m * across_m2 / (distance_m * distance_m + s_m * along_m));
  };
  const double from_rad = azimuth_at(low_m), to_rad = azimuth_at(high_m);
  const auto [least_rad, most_rad] = std::minmax(from_rad, to_rad);
  if (least_rad < azimuths_rad.front() || most_rad > azimuths_rad.front() + 2.0 * kPi) return 0.0;  // across the seam
  const double beside_m = surfel.hits < kManyHits ? kBeside_m : kBesideKnown_m;
  const double beside_rad = beside_m / distance_m;
  const double first_rad = least_rad - beside_rad;
  for (auto beam = first_beam(
           azimuths_rad, [first = static_cast<float>(first_rad)](float a) { return a >= first; }, first_rad);
       beam != azimuths_rad.end() && *beam <= static_cast<float>(most_rad + beside_rad); ++beam) {
    const auto i = static_cast<std::size_t>(beam - azimuths_rad.begin());
    const double range_m = ranges_m()[i];
    const bool beside = *beam < static_cast<float>(least_rad) || *beam > static_cast<float>(most_rad);
    if (beside) {
      if (std::abs(range_m - distance_m) < beside_m) return 0.0;
      continue;
    }
    const double cosine = n_level.dot(rays_[i]);
    const double until_m = n_level.dot(p_level_m) / cosine;  // along the beam, to the element
    const double variance_m2 = surfel.variance_m2 / (cosine * cosine) + hit_sigma_m_ * hit_sigma_m_;
    const double margin_m = std::max(kLeastPassed_m, kPassedSigmas * std::sqrt(variance_m2));
    if (std::abs(range_m - until_m) < margin_m) return 0.0;
    if (range_m > until_m) weight = std::max(weight, range_m >= most_m() ? kNoReturnWeight : 1.0);
  }
  return weight * close_beams(distance_m * resolution_rad_, surfel.thing_m);
}

bool LatestScanView::is_hidden(const Eigen::Vector2d& middle_world_m, double radius_m, double extent_m) const {
  const std::vector<float>& azimuths_rad = azimuth_rad();
  if (azimuths_rad.size() < 2) return true;
  const Eigen::Vector2d middle_level_m = T_level_world() * middle_world_m;
  const double reach_m = radius_m + extent_m + kMostWithin_m, distance_m = middle_level_m.norm();
  if (distance_m <= reach_m) return false;
  const double middle_rad = azimuth_of(middle_level_m), half_rad = std::asin(reach_m / distance_m);
  const double first_rad = middle_rad - half_rad, last_rad = middle_rad + half_rad;
  if (first_rad < azimuths_rad.front() || last_rad > azimuths_rad.front() + 2.0 * kPi) return false;  // across the seam
  const auto first = static_cast<float>(first_rad), last = static_cast<float>(last_rad);
  auto beam = first_beam(
      azimuths_rad, [first](float a) { return a >= first; }, first_rad);
  if (beam != azimuths_rad.begin()) --beam;  // what is between two beams is seen by both
  for (; beam != azimuths_rad.end(); ++beam) {
    if (ranges_m()[static_cast<std::size_t>(beam - azimuths_rad.begin())] > distance_m - reach_m) return false;
    if (*beam > last) break;
  }
  return true;
}

}  // namespace situation_awareness
