// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/path/chain_view.hpp"

#include <algorithm>
#include <cmath>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/simplify.hpp"

namespace situation_awareness {
namespace {

constexpr double kLeastSine = 0.26;        // 15 deg: of the angle between a beam and an edge that is judged
constexpr std::ptrdiff_t kMostBeams = 64;  // on each side, however near a chain is

double cross_m2(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

void ChainView::begin(const Points& points, double range_m, double pose_sigma_m, double pose_sigma_rad) {
  points_ = &points;
  T_level_world_ = inverse(points.T_world_level);
  range_m_ = range_m;
  sigma_m_ = pose_sigma_m;
  sigma_rad_ = pose_sigma_rad;
  beams_.assign(points.points.size(), {});
}

void ChainView::add(const Eigen::Vector2d& from_world_m, const Eigen::Vector2d& to_world_m, double reach_m,
                    std::uint64_t id, bool is_known, bool is_fixed, bool was_seen) {
  const std::vector<Point>& points = points_->points;
  if (points.empty()) return;
  Eigen::Vector2d from_m = T_level_world_ * from_world_m, to_m = T_level_world_ * to_world_m;
  if (distance_from_segment_m(Eigen::Vector2d::Zero(), from_m, to_m) > range_m_) return;
  if (cross_m2(from_m, to_m) < 0.0) std::swap(from_m, to_m);
  const Eigen::Vector2d along_m = to_m - from_m;
  const double length_m = along_m.norm();
  if (!(length_m > 0.0)) return;
  const Eigen::Vector2d n = Eigen::Vector2d(along_m.y(), -along_m.x()) / length_m;  // away from the scanner
  const double span_rad = std::atan2(cross_m2(from_m, to_m), from_m.dot(to_m));
  const double first_rad = points.front().azimuth_rad;
  double begin_rad = std::atan2(from_m.y(), from_m.x());
  begin_rad += 2.0 * kPi * std::ceil((first_rad - begin_rad) / (2.0 * kPi));
  Beam edge;
  edge.id = id;
  edge.is_known = is_known;
  edge.is_fixed = is_fixed;
  edge.was_seen = was_seen;
  for (const double turn_rad : {0.0, 2.0 * kPi}) {  // the rest of an edge across the first beam
    const double low_rad = begin_rad - turn_rad, high_rad = low_rad + span_rad;
    auto at = std::lower_bound(points.begin(), points.end(), low_rad,
                               [](const Point& point, double a_rad) { return point.azimuth_rad < a_rad; });
    for (; at != points.end() && at->azimuth_rad <= high_rad; ++at) {
      take(static_cast<std::size_t>(at - points.begin()), from_m, n, edge, reach_m);
    }
  }
}

void ChainView::take(std::size_t i, const Eigen::Vector2d& from_m, const Eigen::Vector2d& n, const Beam& edge,
                     double reach_m) {
  const double azimuth_rad = points_->points[i].azimuth_rad;
  const double sine = n.dot(Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad)));
  if (!(sine > 1e-6)) return;
  const double near_m = n.dot(from_m) / sine;
  const bool comes_first = edge.was_seen == beams_[i].was_seen ? near_m < beams_[i].near_m : edge.was_seen;
  if (!comes_first) return;
  beams_[i] = edge;
  beams_[i].near_m = near_m;
  beams_[i].wide_m = reach_m + sigma_m_ + sigma_rad_ * near_m;
  if (sine >= kLeastSine) beams_[i].far_m = near_m + beams_[i].wide_m / sine;
}

void ChainView::judge() {
  const auto count = static_cast<std::ptrdiff_t>(beams_.size());
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    Beam& beam = beams_[static_cast<std::size_t>(i)];
    const Point& point = points_->points[static_cast<std::size_t>(i)];
    const bool says = is_hit(point.state) || point.state == BeamState::kFree;
    if (!says || !(beam.far_m <= range_m_) || !(points_->resolution_rad > 0.0)) continue;
    const double width = beam.wide_m / std::max(beam.near_m * points_->resolution_rad, 1e-9);
    const auto beside = width < static_cast<double>(kMostBeams) ? static_cast<std::ptrdiff_t>(width) + 1 : kMostBeams;
    double far_m = 0.0;
    for (std::ptrdiff_t k = i - beside; k <= i + beside && far_m <= range_m_; ++k) {
      const bool is_there = points_->full_circle || (k >= 0 && k < count);
      const Beam& other = beams_[static_cast<std::size_t>(((k % count) + count) % count)];
      far_m = is_there && other.was_seen == beam.was_seen ? std::max(far_m, other.far_m)
                                                          : std::numeric_limits<double>::infinity();
    }
    if (!(far_m <= range_m_)) continue;
    const bool passes = point.range_m > far_m;
    beam.look = !passes ? Look::kAgrees : is_hit(point.state) ? Look::kPasses : Look::kWithoutReturn;
  }
}

}  // namespace situation_awareness
