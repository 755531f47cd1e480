// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// A distribution of segments with ground truth. kEllipse, kCircle, kOccluded, kBoxes and kFaces are exact:
/// docs/math/synthetic_segments.md has their generative model, and the floor is computed from it.
enum class SegmentCase {
  kEllipse,   ///< the ellipse paper's data set (Sect. IV-C): one ellipse alone before the paper's LIDAR
  kCircle,    ///< the circle paper's (Sect. IV-B): radii and centres on a grid
  kOccluded,  ///< as kEllipse, with one end occluded: 30 to 70 % of the beams that would hit
  kProduct,  ///< the mixture for training: any resolution, noise and tilt, hidden ends, mixed pixels, not only ellipses
  kWall,     ///< a wall of 1 to 8 m, alone or with one end hidden
  kCorner,   ///< two walls at a right angle, pointing to the sensor or away from it, alone or with one end hidden
  kBox,      ///< a box with sides of 0.1 to 1 m
  kBush,     ///< leaves: ranges that scatter from beam to beam by more than the noise
  kTwo,      ///< two ellipses so close together that they make one segment
  kBoxes,    ///< a box alone before the paper's LIDAR: as kEllipse, with sides of 0.1 to 1.5 m
  kFaces,    ///< as kBoxes, those that show the sensor one face only
  kShapes,  ///< the mixture for training the shape network: 40 % ellipses, 40 % boxes, with the effects of real sensors
};

/// A random segment with its ground truth.
struct SyntheticSegment {
  Segments segments;                     ///< with one segment, in a level frame
  std::optional<Ellipse> ellipse_level;  ///< the truth, canonical; none if the segment is not one ellipse
  std::optional<Box> box_level;          ///< the truth; none if the segment is not one box
  double range_sigma_m = 0.0;            ///< standard deviation of the noise in the ranges
};

/// One segment of the distribution `which`: the same for the same state of `random`.
SyntheticSegment draw_segment(SegmentCase which, Random& random);

/// The name of a case on a command line (`ellipse`, `circle`, `occluded`, ...), and back; throws std::invalid_argument
/// naming the known ones.
std::string name_of(SegmentCase which);
SegmentCase segment_case(const std::string& name);

}  // namespace situation_awareness
