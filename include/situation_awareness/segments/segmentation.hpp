// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Parameters of segmentation, of the classification of structure (walls, cabinets), and of its straight pieces.
struct SegmentationParams {
  double max_gap_m = 0.2;
  double max_range_gap_m = 0.2;
  int max_missing_beams = 2;
  double min_points_fraction = 0.003;
  int min_points = 4;
  int min_narrow_points = 3;
  double max_object_extent_m = 1.6;
  double min_bulge = 0.1;
  bool free_faces = true;
  double max_division_offset_m = 0.06;

  // Constants of the method, which are not read from YAML.
  /// An end of a segment is occluded if the return beside it is nearer by more than this.
  double occlusion_margin_m = 0.05;
  /// Minimum number of hits of a straight piece of a structure.
  int min_line_points = 5;
  /// Maximum distance of the hits of a straight piece of a structure from its line; about five times the range noise.
  double max_line_offset_m = 0.05;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("max_gap_m", self.max_gap_m, Bounds{0.001, 10.0}, "m",
          "maximum distance between consecutive hits of a segment, in addition to the spacing of their beams", kLive);
    visit("max_range_gap_m", self.max_range_gap_m, Bounds{0.001, 10.0}, "m",
          "maximum difference in range between consecutive hits of a segment", kLive);
    visit("max_missing_beams", self.max_missing_beams, Bounds{0, 100}, "",
          "maximum number of beams without a return between consecutive hits of a segment", kLive);
    visit(
        "min_points_fraction", self.min_points_fraction, Bounds{0.0, 0.5}, "",
        "minimum number of points of a segment, as a fraction of the scan's beams (circle paper, Sect. III-C: 0.003)");
    visit("min_points", self.min_points, Bounds{2, 1000}, "",
          "minimum number of points of a segment, whatever the number of beams", kLive);
    visit("min_narrow_points", self.min_narrow_points, Bounds{2, 1000}, "",
          "minimum number of points of a segment up to 0.2 m wide with something farther away seen beside both ends (a "
          "leg, a post), where that is less than the minimum of others",
          kLive);
    visit("max_object_extent_m", self.max_object_extent_m, Bounds{0.01, 100.0}, "m",
          "maximum extent of an object; a larger segment is structure", kLive);
    visit("min_bulge", self.min_bulge, Bounds{0.0, 1.0}, "",
          "a segment is flat if its RMS distance from a line and its sagitta are both below this fraction of half its "
          "length; 0: none is",
          kLive);
    visit(
        "free_faces", self.free_faces,
        "a flat segment with both edges visible is an object, the face of a box, not structure; with detections/boxes");
    visit("max_division_offset_m", self.max_division_offset_m, Bounds{0.0, 10.0}, "m",
          "in a segment that contains several objects, hits within this distance of a mapped object's outline are "
          "assigned to it; 0: no segment is divided");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// Group the hits of a scan into segments, one per object (circle paper, Sect. III-C), in time linear in the beams.
///
/// Hits outside the volume of interest are grouped too, so that a wall that leaves the volume is still seen as a wall
/// and an object on its border as a whole; segments that lie mostly outside are then dropped. `memory`: as for
/// limit_range.
Segments segment(const Points& points, const SegmentationParams& params, Segments memory = {});

}  // namespace situation_awareness
