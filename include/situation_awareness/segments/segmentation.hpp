// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Which hits are one thing, and which things are structure (walls, cabinets) rather than objects.
struct SegmentationParams {
  double max_gap_m = 0.2;
  double max_range_gap_m = 0.2;
  int max_missing_beams = 2;
  double min_points_fraction = 0.003;
  int min_points = 4;
  double max_object_extent_m = 1.2;
  double max_concavity_m = 0.03;
  double max_structure_offset_m = 0.06;
  double max_straight_rms_m = 0.008;
  double flat_extent_m = 0.4;
  double min_bulge = 0.1;
  double occlusion_margin_m = 0.05;
  double max_division_offset_m = 0.06;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("max_gap_m", self.max_gap_m, Bounds{0.001, 10.0}, "m",
          "largest Cartesian distance between neighbouring hits of one segment, beyond the spacing of their beams",
          kLive);
    visit("max_range_gap_m", self.max_range_gap_m, Bounds{0.001, 10.0}, "m",
          "largest difference in range between neighbouring hits of one segment", kLive);
    visit("max_missing_beams", self.max_missing_beams, Bounds{0, 100}, "",
          "most beams without a hit between neighbouring hits of one segment", kLive);
    visit("min_points_fraction", self.min_points_fraction, Bounds{0.0, 0.5}, "",
          "a segment with fewer points than this part of the beams is dropped (circle paper, Sect. III-C: 0.003)");
    visit("min_points", self.min_points, Bounds{2, 1000}, "",
          "a segment with fewer points than this is dropped, however few beams the scanner has", kLive);
    visit("max_object_extent_m", self.max_object_extent_m, Bounds{0.01, 100.0}, "m",
          "a segment that extends farther is structure, not an object", kLive);
    visit(
        "max_concavity_m", self.max_concavity_m, Bounds{0.0, 10.0}, "m",
        "a segment whose points lie this far behind the chord of its ends, on average, is structure: an inner corner");
    visit(
        "max_structure_offset_m", self.max_structure_offset_m, Bounds{0.0, 10.0}, "m",
        "a piece with a hidden end whose points all lie this close to the line of a structure beside it belongs to it");
    visit("max_straight_rms_m", self.max_straight_rms_m, Bounds{0.0, 10.0}, "m",
          "a piece with a hidden end whose points lie this close to a line, root mean square, may be any wall: "
          "structure");
    visit("flat_extent_m", self.flat_extent_m, Bounds{0.0, 100.0}, "m",
          "a segment that extends at least this far and is flat is structure: the front of a wall or a cabinet");
    visit("min_bulge", self.min_bulge, Bounds{0.0, 1.0}, "",
          "flat is what lies closer to a line than this part of half its length, root mean square, and stands out by "
          "less than this part from its ends to its middle",
          kLive);
    visit("occlusion_margin_m", self.occlusion_margin_m, Bounds{0.0, 10.0}, "m",
          "a neighbour this much nearer than the end of a segment hides what is beside it");
    visit("max_division_offset_m", self.max_division_offset_m, Bounds{0.0, 10.0}, "m",
          "where a segment holds several things, hits this close to the outline of a known object are its own");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// Group the hits of a scan into segments, one per thing (circle paper, Sect. III-C), in time linear in the beams.
///
/// Hits outside the volume of interest are grouped too, so that a wall that leaves the volume is still seen as a wall
/// and an object on its border as a whole; segments that lie mostly outside are then left out.
/// `memory`: as for limit_range.
Segments segment(const Points& points, const SegmentationParams& params, Segments memory = {});

/// Mean distance of points in reading order behind the chord of their ends, as seen from the sensor; negative in front
/// of it, as on any convex thing.
double concavity_m(const Point* points, std::size_t count);

/// True if a segment is long and flat: the front of a wall or a cabinet, whatever else speaks for an object.
bool is_flat(const Segments& segments, const Segment& segment, const SegmentationParams& params);

}  // namespace situation_awareness
