// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// A hit this near to the outline of a mapped object, or inside it, is on it: three times the error that a good map may
/// have, and less than half the distance at which segments are separate objects.
constexpr double kOnOutline_m = 0.15;

/// The objects of a map as areas, for many points.
class MappedAreas {
 public:
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

  /// In place of the objects before, whose memory is reused.
  void set(const Objects& objects);

  /// Index in Objects::objects of the object on which a point of the world is (kOnOutline_m); of several the one with
  /// the nearest outline, kNone if there is none.
  std::size_t object_at(const Eigen::Vector2d& p_world_m) const;

  /// True if the point is on any of them.
  bool cover(const Eigen::Vector2d& p_world_m) const;

 private:
  struct Area {
    Shape shape;
    Ellipse ellipse_world;
    Box box_world;
    Eigen::Vector2d center_world_m;
    double reach_m;  ///< from the centre; a point farther away is not on it
  };

  /// Infinite where the point is out of reach.
  static double offset_from(const Area& area, const Eigen::Vector2d& p_world_m);

  std::vector<Area> areas_;
};

/// The compact segments of a scan that are on no map. Compact are the segments of kind kObject, with a detection or
/// without, of at least kMinHits hits; one is on the map if any of its hits is on a published object.
struct Unmapped {
  int compact = 0;         ///< compact segments of the scan
  int on_no_map = 0;       ///< those of which no hit is on a mapped object
  double for_s = 0.0;      ///< longest time for which the place of one of these has been on no map, to this scan
  double longest_s = 0.0;  ///< the same, of this and all scans before
};

/// Follows the places of compact segments that are on no map from scan to scan, until one is on the map or is structure
/// in a later scan.
class UnmappedSegments {
 public:
  static constexpr std::size_t kMinHits = 8;

  /// The map as published after the scan of the segments. No allocation after warm-up, except for more objects or
  /// places than before. A stamp that goes back is a restart: places are forgotten, `longest_s` is kept.
  const Unmapped& add(const Segments& segments, const Objects& objects);

 private:
  struct Place {
    Eigen::Vector2d p_world_m;
    std::int64_t since_ns;
    std::int64_t last_ns;  ///< of the latest scan in which it was on no map
  };

  void see_unmapped(const Eigen::Vector2d& p_world_m, std::int64_t stamp_ns);
  void see_mapped(const Eigen::Vector2d& p_world_m, std::int64_t stamp_ns);
  void see_structure(const Segments& segments);

  MappedAreas areas_;
  std::vector<Place> places_;
  std::vector<Eigen::Vector2d> mapped_world_m_;  ///< middles of this scan's compact segments on the map
  Unmapped result_;
  std::int64_t stamp_ns_ = 0;
};

}  // namespace situation_awareness
