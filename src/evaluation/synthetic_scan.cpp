// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic_scan.hpp"

#include <algorithm>

namespace situation_awareness::synthetic {
namespace {

constexpr int kMaxMissingBeams = 2;

double range_to(const Edge& edge, const Eigen::Vector2d& u) {
  const Eigen::Vector2d along = edge.second - edge.first;
  const double determinant = along.x() * u.y() - along.y() * u.x();
  if (std::abs(determinant) < 1e-12) return kMissM;
  const double range = (along.x() * edge.first.y() - along.y() * edge.first.x()) / determinant;
  const double place = (u.x() * edge.first.y() - u.y() * edge.first.x()) / determinant;
  return range > 0.0 && place >= 0.0 && place <= 1.0 ? range : kMissM;
}

/// Azimuths of the two tangents of an ellipse from the sensor, which is outside of it. Scaled along its axes the
/// ellipse is the unit circle, whose tangents from a point are known; the scaling maps them to tangents.
std::pair<double, double> tangent_azimuths(const Ellipse& ellipse) {
  const Eigen::Vector2d center_own = Eigen::Rotation2Dd(-ellipse.psi_rad) * ellipse.center_m;
  const Eigen::Vector2d scaled(center_own.x() / ellipse.rx_m, center_own.y() / ellipse.ry_m);
  const double half_angle = std::asin(1.0 / scaled.norm());
  const double bearing = std::atan2(ellipse.center_m.y(), ellipse.center_m.x());
  const auto tangent = [&](double side) {
    const double angle = std::atan2(scaled.y(), scaled.x()) + side * half_angle;
    const double own = std::atan2(ellipse.ry_m * std::sin(angle), ellipse.rx_m * std::cos(angle)) + ellipse.psi_rad;
    return bearing + wrap_to_pi(own - bearing);
  };
  return {tangent(-1.0), tangent(+1.0)};
}

/// Nearest and farthest distance of a curve from the sensor, found among points on it.
std::pair<double, double> distances(const Ellipse& ellipse) {
  constexpr int kPlaces = 64;
  double low = kMissM;
  double high = 0.0;
  const Eigen::Rotation2Dd turn(ellipse.psi_rad);
  for (int i = 0; i < kPlaces; ++i) {
    const double angle = 2.0 * kPi * i / kPlaces;
    const double r =
        (ellipse.center_m + turn * Eigen::Vector2d(ellipse.rx_m * std::cos(angle), ellipse.ry_m * std::sin(angle)))
            .norm();
    low = std::min(low, r);
    high = std::max(high, r);
  }
  return {low, high};
}

}  // namespace

double range_to(const Thing& thing, double azimuth_rad) {
  const Eigen::Vector2d u(std::cos(azimuth_rad), std::sin(azimuth_rad));
  double nearest = kMissM;
  for (const Ellipse& ellipse : thing.ellipses) {
    nearest = std::min(nearest, intersect_ray(ellipse, Eigen::Vector2d::Zero(), u).value_or(kMissM));
  }
  for (const Edge& edge : thing.edges) nearest = std::min(nearest, range_to(edge, u));
  return nearest;
}

std::pair<double, double> azimuths_of(const Thing& thing) {
  double low = kMissM;
  double high = -kMissM;
  for (const Ellipse& ellipse : thing.ellipses) {
    const auto [right, left] = tangent_azimuths(ellipse);
    low = std::min(low, right);
    high = std::max(high, left);
  }
  for (const Edge& edge : thing.edges) {
    const double first = std::atan2(edge.first.y(), edge.first.x());
    const double second = first + wrap_to_pi(std::atan2(edge.second.y(), edge.second.x()) - first);
    low = std::min({low, first, second});
    high = std::max({high, first, second});
  }
  return {low, high};
}

bool within_range(const Ellipse& ellipse, double max_range_m) {
  const double distance_m = ellipse.center_m.norm();
  if (distance_m - ellipse.rx_m > kMinRangeM && distance_m + ellipse.rx_m < max_range_m) return true;
  if (distance_m - ellipse.ry_m > max_range_m || contains(ellipse, Eigen::Vector2d::Zero())) return false;
  const auto [low, high] = distances(ellipse);
  return low > kMinRangeM && high < max_range_m;
}

Hits cast(const Thing& thing, const Scanner& scanner) {
  const auto [low, high] = azimuths_of(thing);
  // A tilt moves azimuths by less than two degrees.
  const double margin_rad = scanner.tilt_rad == 0.0 ? 0.0 : radians(2.0);
  const int begin = scanner.beam_near(low - margin_rad) - 1;
  const int end = scanner.beam_near(high + margin_rad) + 2;
  Hits hits;
  if (begin < 0 || end > scanner.beams()) return hits;
  for (int k = begin; k < end; ++k) {
    const double range_m = range_to(thing, scanner.azimuth_rad(k));
    const bool hit = range_m > kMinRangeM && range_m < scanner.max_range_m;
    if (hits.ranges_m.empty()) {
      if (!hit) continue;
      hits.first = k;
    }
    hits.ranges_m.push_back(hit ? range_m : kMissM);
  }
  while (!hits.ranges_m.empty() && std::isinf(hits.ranges_m.back())) hits.ranges_m.pop_back();
  return hits;
}

bool is_one_segment(const Hits& hits) {
  int missing = 0;
  double previous_m = hits.ranges_m.front();
  for (const double range_m : hits.ranges_m) {
    if (std::isinf(range_m)) {
      if (++missing > kMaxMissingBeams) return false;
      continue;
    }
    if (std::abs(range_m - previous_m) > kMaxRangeGapM) return false;
    missing = 0;
    previous_m = range_m;
  }
  return true;
}

void hide(Hits& hits, Ends& ends, bool right, int hidden, int beyond) {
  if (right) {
    hits.ranges_m.erase(hits.ranges_m.begin(), hits.ranges_m.begin() + hidden);
    hits.first += hidden;
    ends.right = SegmentEnd::kOccluded;
    ends.right_blocked = hidden + beyond;
  } else {
    hits.ranges_m.resize(hits.ranges_m.size() - static_cast<std::size_t>(hidden));
    ends.left = SegmentEnd::kOccluded;
    ends.left_blocked = hidden + beyond;
  }
}

bool hide_one_end(Hits& hits, Ends& ends, int min_visible, Random& random) {
  constexpr int kMaxBeyond = 20;
  const int n = hits.count();
  const int fewest = static_cast<int>(std::ceil(0.3 * n));
  const int most = std::min(static_cast<int>(std::floor(0.7 * n)), n - min_visible);
  if (most < fewest) return false;
  const bool right = chance(random, 0.5);
  const int hidden = uniform_int(random, fewest, most);
  hide(hits, ends, right, hidden, uniform_int(random, 0, kMaxBeyond));
  return true;
}

void add_noise(Hits& hits, const Scanner& scanner, Random& random, double correlation) {
  const double sigma_m = scanner.noise * scanner.range_sigma_m;
  double error = 0.0;
  for (int i = 0; i < hits.count(); ++i) {
    double& range_m = hits.ranges_m[static_cast<std::size_t>(i)];
    if (std::isinf(range_m)) continue;
    const bool first = i == 0;
    error = first ? random.normal() : correlation * error + std::sqrt(1.0 - square(correlation)) * random.normal();
    range_m += sigma_m * scanner.horizontal(hits.first + i) * error;
  }
}

SyntheticSegment make_segment(const Hits& hits, const Ends& ends, const Scanner& scanner,
                              const std::optional<Ellipse>& ellipse, const std::optional<Box>& box) {
  SyntheticSegment result;
  result.range_sigma_m = scanner.range_sigma_m;
  if (ellipse) result.ellipse_level = canonical(*ellipse);
  result.box_level = box;
  Segments& segments = result.segments;
  segments.resolution_rad = scanner.resolution_rad;
  for (int i = 0; i < hits.count(); ++i) {
    const double range_m = hits.ranges_m[static_cast<std::size_t>(i)];
    if (std::isinf(range_m)) continue;
    Point point;
    point.beam = hits.first + i;
    point.azimuth_rad = scanner.azimuth_rad(point.beam);
    point.range_m = range_m;
    point.p_level_m = range_m * Eigen::Vector2d(std::cos(point.azimuth_rad), std::sin(point.azimuth_rad));
    point.state = BeamState::kHit;
    segments.points.push_back(point);
  }
  Segment segment;
  segment.count = segments.points.size();
  segment.right_end = ends.right;
  segment.left_end = ends.left;
  segment.right_hidden_rad = ends.right_blocked * scanner.resolution_rad;
  segment.left_hidden_rad = ends.left_blocked * scanner.resolution_rad;
  segments.segments.push_back(segment);
  return result;
}

}  // namespace situation_awareness::synthetic
