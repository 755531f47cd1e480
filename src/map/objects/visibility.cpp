// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/visibility.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

Sight look_at(const Ellipse& ellipse_level, const FreeSpace& free_space, double margin_m) {
  // Fraction of the half breadth, from the centre, within which beams are counted. No source is recorded. In
  // flights 0.25 and 1 change no figure beyond chance.
  constexpr double kInnerPart = 0.5;
  const std::vector<float>& azimuths = free_space.azimuth_rad;
  const double distance_m = ellipse_level.center_m.norm();
  if (azimuths.size() < 2 || contains(ellipse_level, Eigen::Vector2d::Zero())) return Sight::kHidden;

  // Half widths of the ellipse across and along the line of sight.
  const Eigen::Vector2d along = ellipse_level.center_m / distance_m;
  const Eigen::Vector2d across(-along.y(), along.x());
  const double half_breadth_m = half_width_m(ellipse_level, across);
  const double half_depth_m = half_width_m(ellipse_level, along);
  const double spacing_rad =
      static_cast<double>(azimuths.back() - azimuths.front()) / static_cast<double>(azimuths.size() - 1);
  const double reach_rad = std::max(kInnerPart * std::atan2(half_breadth_m, distance_m), 0.5 * spacing_rad);

  // The azimuth, wrapped to the range of the scan.
  double azimuth_rad = std::atan2(along.y(), along.x());
  const double first_rad = azimuths.front() - reach_rad;
  azimuth_rad += 2.0 * kPi * std::ceil((first_rad - azimuth_rad) / (2.0 * kPi));

  int through = 0;
  int hit = 0;
  int stopped = 0;
  for (const double turned_rad : {azimuth_rad, azimuth_rad + 2.0 * kPi}) {  // across the seam of a full circle
    auto beam = std::lower_bound(azimuths.begin(), azimuths.end(), turned_rad - reach_rad);
    for (; beam != azimuths.end() && *beam <= turned_rad + reach_rad; ++beam) {
      const double range_m = free_space.range_m[static_cast<std::size_t>(beam - azimuths.begin())];
      if (range_m > distance_m + half_depth_m + margin_m) {
        ++through;
      } else if (range_m >= distance_m - half_depth_m - margin_m) {
        ++hit;
      } else {
        ++stopped;
      }
    }
  }
  const int known = through + hit + stopped;
  if (2 * through > known) return Sight::kSeenThrough;
  if (2 * hit > known) return Sight::kHit;
  return Sight::kHidden;
}

}  // namespace situation_awareness
