// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/scanner_watch.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/simplify.hpp"

namespace situation_awareness {
namespace {

constexpr int kLeastHits = 20;
constexpr int kRepeats = 2;
constexpr std::int64_t kRenewed = 50;
constexpr double kMoved_m = 0.01;  // of a hit, from where the first of the scans that are alike saw something
constexpr int kMovedHits = 10;
constexpr std::ptrdiff_t kBeside = 4;  // beams
constexpr double kNoise_m = 1e-4;      // a smaller difference may be of rounding
constexpr int kLeastPairs = 100;
// Differences of ranges of neighbouring beams have the same sign by motion, and by chance as often as not.
constexpr double kMostAlike = 0.7;

constexpr std::size_t kLeastJudged = 20;
constexpr double kShareOfAll = 0.5, kShareOfQuarter = 0.8;

constexpr double kShareSeen = 0.05, kGap_s = 2.0;

bool is_range(float range_m) { return std::isfinite(range_m) && range_m > 0.0F; }

/// What a scan says of a quarter about the vehicle, or of all.
struct Sector {
  std::size_t beams = 0, returns = 0, hits = 0;  ///< hits: returns, and what is too close for one
  std::size_t judged = 0, passing = 0, without_return = 0;
  std::uint64_t first_id = 0;
  bool is_more = false;  ///< than one thing that was taken away
  std::size_t near_before = 0, near_now = 0, lost = 0;
  Eigen::Vector2d low_m = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity()), high_m = -low_m;

  void add(const Point& point, const ChainView::Beam& beam, bool has_seen) {
    ++beams;
    returns += is_hit(point.state) ? 1 : 0;
    hits += is_hit(point.state) || point.state == BeamState::kTooClose ? 1 : 0;
    if (beam.look == ChainView::Look::kNotJudged || !beam.is_known || (has_seen && !beam.was_seen)) return;
    ++judged;
    if (beam.look == ChainView::Look::kAgrees) return;
    if (passing++ == 0) first_id = beam.id;
    is_more = is_more || beam.is_fixed || beam.id != first_id;
    without_return += beam.look == ChainView::Look::kWithoutReturn ? 1 : 0;
  }

  /// With the same beam of the scan before.
  void compare(const Point& before, const Point& now, double range_m) {
    const auto is_near = [&](const Point& point) { return is_hit(point.state) && point.range_m <= range_m; };
    near_now += is_near(now) ? 1 : 0;
    if (!is_near(before)) return;
    ++near_before;
    if (now.state != BeamState::kFree) return;
    ++lost;
    const Eigen::Vector2d p_m =
        before.range_m * Eigen::Vector2d(std::cos(before.azimuth_rad), std::sin(before.azimuth_rad));
    low_m = low_m.cwiseMin(p_m);
    high_m = high_m.cwiseMax(p_m);
  }

  bool sees() const { return returns > 0 && static_cast<double>(returns) >= kShareSeen * static_cast<double>(beams); }

  bool passes_through(double share) const {
    return is_more && judged >= kLeastJudged && static_cast<double>(passing) >= share * static_cast<double>(judged);
  }

  bool has_lost(double share) const {
    return near_before >= kLeastJudged && static_cast<double>(lost) >= share * static_cast<double>(near_before) &&
           2 * near_now < near_before && (high_m - low_m).norm() >= ChainView::kFixed_m;
  }
};

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
    is_found_ = false;
    renewed_after_ = kRenewed;
    renewed_at_ = renewed_after_;
    return false;
  }
  ++repeats_;
  // A pose that was wrong for a moment does not keep a vehicle for ever that stands and sees the same without noise. It
  // waits twice as long each time, since one whose scanner repeats itself moves on until that is found again.
  if (repeats_ >= renewed_at_) {
    first_ = points;
    if (is_found_) renewed_after_ *= 2;
    renewed_at_ = repeats_ + renewed_after_;
    is_found_ = false;
  }
  is_found_ = is_found_ || (repeats_ >= kRepeats && (is_noisy() || has_moved_along(points)));
  return is_found_;
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
  const double gap_s = seconds_between(before_ns_, points.stamp_ns);
  if (gap_s < 0.0 || gap_s > kGap_s) {
    has_seen_.fill(false);
    before_.clear();
  }
  std::array<Sector, kSectors> sectors{};
  const bool is_alike = before_.size() == points.points.size();
  const double ahead_rad = wrap_to_pi(base_yaw_rad - points.T_world_level.yaw_rad);
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    const Point& point = points.points[i];
    const double azimuth_rad = wrap_to_pi(point.azimuth_rad - ahead_rad);
    const std::size_t quarter = static_cast<std::size_t>(std::lround(azimuth_rad / (0.5 * kPi)) + 4) % kAll;
    for (const std::size_t k : {quarter, kAll}) {
      sectors[k].add(point, view.beams()[i], has_seen_[k]);
      if (is_alike) sectors[k].compare(before_[i], point, view.range_m());
    }
  }
  bool is_blind = false;
  for (std::size_t k = 0; k < kSectors; ++k) {
    const Sector& sector = sectors[k];
    has_seen_[k] = has_seen_[k] || sector.sees();
    if (sector.hits >= needed_hits_[k]) needed_hits_[k] = 0;
    const double share = k == kAll ? kShareOfAll : kShareOfQuarter;
    if (sector.passes_through(share)) {
      is_blind = true;
      if (2 * sector.without_return >= sector.passing) {
        needed_hits_[k] = std::max(needed_hits_[k], (sector.judged + 1) / 2);
      }
    }
    if (sector.has_lost(share)) needed_hits_[k] = std::max(needed_hits_[k], (sector.near_before + 1) / 2);
    is_blind = is_blind || needed_hits_[k] > 0;
  }
  before_.assign(points.points.begin(), points.points.end());
  before_ns_ = points.stamp_ns;
  return is_blind || !has_seen();
}

}  // namespace situation_awareness
