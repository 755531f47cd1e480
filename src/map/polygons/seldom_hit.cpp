// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/polygons/seldom_hit.hpp"

#include <algorithm>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

/// An element that was hit by less than this part of the scans that hit one beside it, after so many s, is no surface.
constexpr double kRare = 0.2;
constexpr double kRareAfter_s = 5.0;
/// An element that has none beside it is no surface if it was hit for less than this part of its age, and of so many s.
constexpr double kLonely = 0.03;
constexpr double kLonely_s = 1.5;

/// s. An element as old as `own_age_s` would have been hit for so long, if it was hit as one beside it.
double expected_by(double other_seen_s, double other_share, double own_age_s) {
  return std::min(other_seen_s, other_share * own_age_s);
}

}  // namespace

double SeldomHit::seen_share(double seen_s, double age_s) { return seen_s / std::max(age_s, kRareAfter_s); }

void SeldomHit::judge(std::vector<LinkElement>& elements, std::size_t place, const NearElements& near) {
  LinkElement& own = elements[place];
  double expected_s = own.seen_s, seen_s = own.seen_s;
  double compared = 1.0;
  own.is_crossed = false;
  near.for_each(static_cast<NearElements::Index>(place), [&](NearElements::Index j) {
    const LinkElement& other = elements[static_cast<std::size_t>(j)];
    const double part = (other.p_world_m - own.p_world_m).squaredNorm() <= kReach_m * kReach_m ? 1.0 : 0.0;
    expected_s += part * expected_by(other.seen_s, other.seen_share, own.age_s);
    seen_s += part * other.seen_s;
    compared += part;
    own.is_crossed |= other.faces_another_way(own);
  });
  own.is_shown = own.age_s < kRareAfter_s || own.seen_s >= kRare * expected_s / compared;
  own.is_ageing = own.is_shown && own.seen_s < kRare * seen_s / compared;
}

bool SeldomHit::is_lonely(const Surfel& surfel, std::int64_t stamp_ns) {
  const double age_s = seconds_between(surfel.first_seen_ns, stamp_ns);
  return age_s > kRareAfter_s && surfel.seen_s < std::min(kLonely * age_s, kLonely_s);
}

bool SeldomHit::may_get_lonely(const Surfel& surfel) { return surfel.seen_s < kLonely_s; }

/// Searches the ages of the element, on which judge() and is_lonely() depend.
std::int64_t SeldomHit::hidden_from_ns(const Surfels& surfels, Index index, bool is_alone) {
  constexpr std::int64_t kStep_ns = 1'000'000;
  constexpr std::int64_t kLongest_ns = 1'000'000 * kNanosecondsPerSecond;
  const Surfel& own = surfels[index];
  std::int64_t result_ns = kNever;
  if (is_alone && may_get_lonely(own)) {
    result_ns = own.first_seen_ns + nanoseconds(std::max(kRareAfter_s, own.seen_s / kLonely)) + kStep_ns;
  }
  beside_.clear();
  double seen_s = own.seen_s;
  surfels.for_each_near(own.p_world_m, kReach_m, [&](Index i, const Surfel& other) {
    const double distance_m2 = (other.p_world_m - own.p_world_m).squaredNorm();
    if (i == index || !other.confirmed || distance_m2 > kReach_m * kReach_m) return;
    beside_.push_back({other.seen_s, other.first_seen_ns});
    seen_s += other.seen_s;
  });
  const double elements = 1.0 + static_cast<double>(beside_.size());
  if (own.seen_s >= kRare * seen_s / elements) return result_ns;
  const auto is_rare = [&](std::int64_t stamp_ns) {
    const double age_s = seconds_between(own.first_seen_ns, stamp_ns);
    double expected_s = own.seen_s;
    for (const Beside& other : beside_) {
      const double share = seen_share(other.seen_s, seconds_between(other.first_seen_ns, stamp_ns));
      expected_s += expected_by(other.seen_s, share, age_s);
    }
    return own.seen_s < kRare * expected_s / elements;
  };
  std::int64_t low_ns = own.first_seen_ns + nanoseconds(kRareAfter_s);
  if (is_rare(low_ns)) return std::min(result_ns, low_ns);
  std::int64_t way_ns = kNanosecondsPerSecond;
  while (way_ns < kLongest_ns && !is_rare(low_ns + way_ns)) way_ns *= 2;
  if (way_ns >= kLongest_ns) return result_ns;
  std::int64_t high_ns = low_ns + way_ns;
  while (high_ns - low_ns > kStep_ns) {
    const std::int64_t middle_ns = low_ns + (high_ns - low_ns) / 2;
    (is_rare(middle_ns) ? high_ns : low_ns) = middle_ns;
  }
  return std::min(result_ns, high_ns);
}

}  // namespace situation_awareness
