// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/unmapped_segments.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
namespace {

/// m. The middles of a segment in two scans are this near to each other: a person at 1.5 m/s moves by 0.35 m between
/// scans at 4.3 Hz. Two things this near are one place, which makes times longer, not shorter.
constexpr double kSamePlace_m = 0.4;
/// The legs of a walking person are up to this far from the person's middle, beyond the outline of the torso.
constexpr double kLegsReach_m = 0.45;
/// s. A place whose segment is not seen (hidden, divided, of fewer hits) for this long is forgotten.
constexpr double kForget_s = 0.5;

}  // namespace

void MappedAreas::set(const Objects& objects) {
  areas_.clear();
  for (const Object& object : objects.objects) {
    const bool is_box = object.shape == Shape::kBox;
    Ellipse ellipse = object.ellipse_world;
    if (object.object_class == ObjectClass::kPerson) {
      ellipse.rx_m = std::max(ellipse.rx_m, kLegsReach_m);
      ellipse.ry_m = std::max(ellipse.ry_m, kLegsReach_m);
    }
    const Box& box = object.box_world;
    const double size_m =
        is_box ? std::hypot(box.half_length_m, box.half_width_m) : std::max(ellipse.rx_m, ellipse.ry_m);
    areas_.push_back({object.shape, ellipse, box, is_box ? box.center_m : ellipse.center_m, size_m + kOnOutline_m});
  }
}

double MappedAreas::offset_from(const Area& area, const Eigen::Vector2d& p_world_m) {
  if ((p_world_m - area.center_world_m).squaredNorm() > area.reach_m * area.reach_m) {
    return std::numeric_limits<double>::infinity();
  }
  return area.shape == Shape::kBox ? offset_m(area.box_world, p_world_m) : offset_m(area.ellipse_world, p_world_m);
}

bool MappedAreas::cover(const Eigen::Vector2d& p_world_m) const {
  return std::any_of(areas_.begin(), areas_.end(),
                     [&](const Area& area) { return offset_from(area, p_world_m) <= kOnOutline_m; });
}

std::size_t MappedAreas::object_at(const Eigen::Vector2d& p_world_m) const {
  std::size_t nearest = kNone;
  double nearest_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < areas_.size(); ++i) {
    const Area& area = areas_[i];
    const double offset = offset_from(area, p_world_m);
    if (!(offset <= kOnOutline_m) || std::abs(offset) >= nearest_m) continue;
    nearest = i;
    nearest_m = std::abs(offset);
  }
  return nearest;
}

void UnmappedSegments::see_unmapped(const Eigen::Vector2d& p_world_m, std::int64_t stamp_ns) {
  Place* nearest = nullptr;
  double nearest_m = kSamePlace_m;
  for (Place& place : places_) {
    const double distance_m = (place.p_world_m - p_world_m).norm();
    if (place.last_ns == stamp_ns || distance_m > nearest_m) continue;
    nearest = &place;
    nearest_m = distance_m;
  }
  if (nearest == nullptr) nearest = &places_.emplace_back(Place{p_world_m, stamp_ns, stamp_ns});
  nearest->p_world_m = p_world_m;
  nearest->last_ns = stamp_ns;
  result_.for_s = std::max(result_.for_s, seconds_between(nearest->since_ns, stamp_ns));
}

/// What was there is now on the map.
void UnmappedSegments::see_mapped(const Eigen::Vector2d& p_world_m, std::int64_t stamp_ns) {
  const auto is_here = [&](const Place& place) {
    return place.last_ns != stamp_ns && (place.p_world_m - p_world_m).norm() <= kSamePlace_m;
  };
  places_.erase(std::remove_if(places_.begin(), places_.end(), is_here), places_.end());
}

/// What was there is now seen as a wall, or as a part of one.
void UnmappedSegments::see_structure(const Segments& segments) {
  const Pose2 T_level_world = inverse(segments.T_world_level);
  const auto is_structure = [&](const Place& place) {
    if (place.last_ns == segments.stamp_ns) return false;
    const Eigen::Vector2d p_level_m = T_level_world * place.p_world_m;
    return std::any_of(segments.segments.begin(), segments.segments.end(), [&](const Segment& segment) {
      if (segment.kind != SegmentKind::kStructure) return false;
      const auto* const first = &segments.points[segment.first];
      return std::any_of(first, first + segment.count,
                         [&](const Point& point) { return (point.p_level_m - p_level_m).norm() <= kOnOutline_m; });
    });
  };
  places_.erase(std::remove_if(places_.begin(), places_.end(), is_structure), places_.end());
}

const Unmapped& UnmappedSegments::add(const Segments& segments, const Objects& objects) {
  const std::int64_t stamp_ns = segments.stamp_ns;
  const auto is_forgotten = [&](const Place& place) {
    return stamp_ns < stamp_ns_ || seconds_between(place.last_ns, stamp_ns) > kForget_s;
  };
  places_.erase(std::remove_if(places_.begin(), places_.end(), is_forgotten), places_.end());
  stamp_ns_ = stamp_ns;
  areas_.set(objects);
  mapped_world_m_.clear();
  result_.compact = result_.on_no_map = 0;
  result_.for_s = 0.0;
  const Eigen::Matrix2d R_world_level = segments.T_world_level.rotation();
  const auto to_world = [&](const Eigen::Vector2d& p_level_m) {
    return Eigen::Vector2d(R_world_level * p_level_m + segments.T_world_level.translation_m);
  };
  for (const Segment& segment : segments.segments) {
    if (segment.kind != SegmentKind::kObject || segment.count < kMinHits) continue;
    ++result_.compact;
    const auto* const first = &segments.points[segment.first];
    const bool is_mapped = std::any_of(first, first + segment.count,
                                       [&](const Point& point) { return areas_.cover(to_world(point.p_level_m)); });
    const Eigen::Vector2d p_world_m = to_world(middle_level_m(segments, segment));
    if (is_mapped) {
      mapped_world_m_.push_back(p_world_m);
    } else {
      ++result_.on_no_map;
      see_unmapped(p_world_m, stamp_ns);
    }
  }
  for (const Eigen::Vector2d& p_world_m : mapped_world_m_) see_mapped(p_world_m, stamp_ns);
  see_structure(segments);
  result_.longest_s = std::max(result_.longest_s, result_.for_s);
  return result_;
}

}  // namespace situation_awareness
