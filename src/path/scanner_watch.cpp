// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/scanner_watch.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/simplify.hpp"

namespace situation_awareness {
namespace {

constexpr int kLeastHits = 20;
constexpr int kRepeats = 2, kRenewed = 50;
constexpr double kMoved_m = 0.01;  // of a hit, from where the first of the scans that are alike saw something
constexpr int kMovedHits = 10;
constexpr std::ptrdiff_t kBeside = 4;  // beams
constexpr double kNoise_m = 1e-4;      // a smaller difference may be of rounding
constexpr int kLeastPairs = 100;
// Differences of ranges of neighbouring beams have the same sign by motion, and by chance as often as not.
constexpr double kMostAlike = 0.7;

constexpr std::size_t kLeastJudged = 20;
constexpr double kShareOfAll = 0.5, kShareOfQuarter = 0.8;

bool is_range(float range_m) { return std::isfinite(range_m) && range_m > 0.0F; }

}  // namespace

bool RepeatedScans::add(const std::vector<float>& ranges_m, const Points& points) {
  const auto hits = std::count_if(ranges_m.begin(), ranges_m.end(), is_range);
  const bool is_alike = hits >= kLeastHits && ranges_m.size() == before_m_.size() &&
                        std::memcmp(ranges_m.data(), before_m_.data(), ranges_m.size() * sizeof(float)) == 0;
  if (!is_alike) {
    if (ranges_m.size() == before_m_.size()) look_for_noise(ranges_m);
    before_m_.assign(ranges_m.begin(), ranges_m.end());
    first_ = points;
    repeats_ = 0;
    return false;
  }
  ++repeats_;
  // A pose that was wrong for a moment does not keep a vehicle for ever that stands and sees the same without noise.
  if (repeats_ % kRenewed == 0) first_ = points;
  return repeats_ >= kRepeats && (is_noisy() || has_moved_along(points));
}

/// Whether hits are where the first scan saw nothing: they moved with the vehicle. In a uniform corridor they do not.
bool RepeatedScans::has_moved_along(const Points& points) const {
  if (points.points.size() != first_.points.size()) return false;
  const Pose2 T_first_now = inverse(first_.T_world_level) * points.T_world_level;
  const auto count = static_cast<std::ptrdiff_t>(points.points.size());
  const auto hit = [&](std::ptrdiff_t i) {
    return first_.points[static_cast<std::size_t>(i)].state == BeamState::kHit;
  };
  const auto place_m = [&](std::ptrdiff_t i) { return first_.points[static_cast<std::size_t>(i)].p_level_m; };
  int moved = 0;
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const Point& point = points.points[static_cast<std::size_t>(i)];
    if (point.state != BeamState::kHit) continue;
    const Eigen::Vector2d p_m = T_first_now * point.p_level_m;
    double nearest_m = std::numeric_limits<double>::infinity();
    for (std::ptrdiff_t k = std::max<std::ptrdiff_t>(i - kBeside, 0); k + 1 < std::min(i + kBeside + 1, count); ++k) {
      if (hit(k) && hit(k + 1))
        nearest_m = std::min(nearest_m, distance_from_segment_m(p_m, place_m(k), place_m(k + 1)));
    }
    moved += std::isfinite(nearest_m) && nearest_m > kMoved_m ? 1 : 0;
  }
  return moved >= kMovedHits;
}

void RepeatedScans::look_for_noise(const std::vector<float>& ranges_m) {
  if (is_noisy()) return;
  int pairs = 0, alike = 0;
  double before_m = 0.0;
  for (std::size_t i = 0; i < ranges_m.size(); ++i) {
    const bool both = is_range(ranges_m[i]) && is_range(before_m_[i]);
    const double now_m = both ? static_cast<double>(ranges_m[i]) - static_cast<double>(before_m_[i]) : 0.0;
    if (std::abs(now_m) > kNoise_m && std::abs(before_m) > kNoise_m) {
      ++pairs;
      alike += now_m * before_m > 0.0 ? 1 : 0;
    }
    before_m = now_m;
  }
  const bool is_noise = pairs >= kLeastPairs && alike < kMostAlike * pairs;
  noisy_scans_ = is_noise ? noisy_scans_ + 1 : 0;
}

bool BlindScanner::add(const Points& points, const ChainView& view, double base_yaw_rad) {
  constexpr std::size_t kAll = 4;
  std::array<std::size_t, 5> judged{}, passing{}, without_return{}, hits{};
  std::array<std::uint64_t, 5> first_id{};
  std::array<bool, 5> is_more{};  // than one thing that was taken away
  const double ahead_rad = wrap_to_pi(base_yaw_rad - points.T_world_level.yaw_rad);
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    const ChainView::Beam& beam = view.beams()[i];
    const double azimuth_rad = wrap_to_pi(points.points[i].azimuth_rad - ahead_rad);
    const std::size_t quarter = static_cast<std::size_t>(std::lround(azimuth_rad / (0.5 * kPi)) + 4) % kAll;
    for (const std::size_t k : {quarter, kAll}) {
      hits[k] += is_hit(points.points[i].state) || points.points[i].state == BeamState::kTooClose ? 1 : 0;
      if (beam.look == ChainView::Look::kNotJudged || !beam.is_known) continue;
      ++judged[k];
      if (beam.look == ChainView::Look::kAgrees) continue;
      if (passing[k]++ == 0) first_id[k] = beam.id;
      is_more[k] = is_more[k] || beam.is_fixed || beam.id != first_id[k];
      without_return[k] += beam.look == ChainView::Look::kWithoutReturn ? 1 : 0;
    }
  }
  bool is_contradiction = false;
  for (std::size_t k = 0; k <= kAll; ++k) {
    if (hits[k] >= needed_hits_[k]) needed_hits_[k] = 0;
    const double share = (k == kAll ? kShareOfAll : kShareOfQuarter) * static_cast<double>(judged[k]);
    if (is_more[k] && judged[k] >= kLeastJudged && static_cast<double>(passing[k]) >= share) {
      is_contradiction = true;
      if (2 * without_return[k] >= passing[k]) needed_hits_[k] = std::max(needed_hits_[k], (judged[k] + 1) / 2);
    }
    is_contradiction = is_contradiction || needed_hits_[k] > 0;
  }
  return is_contradiction;
}

}  // namespace situation_awareness
