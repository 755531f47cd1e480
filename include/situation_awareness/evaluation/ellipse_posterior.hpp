// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/geometry/ellipse.hpp"

namespace situation_awareness {

enum class ObjectShape : std::uint8_t {
  kEllipse,  ///< rx uniform, ry uniform up to rx, psi uniform (ellipse paper, Sect. IV-C)
  kCircle,   ///< r uniform (circle paper, Sect. IV-B, without its grid)
};

/// Generative model of a synthetic segment: a shape with its centre uniform over the sensor's disc, kept if all of it
/// lies within range and field of view, noisy ranges, and possibly an occluder before one of its ends
/// (docs/math/floor.md, Sect. "The model").
struct SegmentModel {
  ObjectShape shape = ObjectShape::kEllipse;
  double resolution_rad = 0.25 * 3.14159265358979323846 / 180.0;
  double first_azimuth_rad = -135.0 * 3.14159265358979323846 / 180.0;
  int beams = 1081;
  double range_sigma_m = 0.01;
  double min_range_m = 0.1;
  double max_range_m = 10.0;
  double min_radius_m = 0.05;
  double max_radius_m = 0.5;
  int min_hits = 5;
  double min_hidden_share = 0.3;
  double max_hidden_share = 0.7;
  int max_beyond_beams = 20;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("resolution_rad", self.resolution_rad, Bounds{1e-4, 0.1}, "rad", "azimuth between neighbouring beams");
    visit("first_azimuth_rad", self.first_azimuth_rad, Bounds{-6.3, 6.3}, "rad", "azimuth of beam 0");
    visit("beams", self.beams, Bounds{3, 100000}, "", "number of beams");
    visit("range_sigma_m", self.range_sigma_m, Bounds{1e-4, 1.0}, "m", "standard deviation of the range noise");
    visit("min_range_m", self.min_range_m, Bounds{0.0, 1000.0}, "m", "minimum range of any point of the object");
    visit("max_range_m", self.max_range_m, Bounds{0.1, 1000.0}, "m", "maximum range of any point of the object");
    visit("min_radius_m", self.min_radius_m, Bounds{1e-3, 100.0}, "m", "lower end of the prior of both radii");
    visit("max_radius_m", self.max_radius_m, Bounds{1e-3, 100.0}, "m", "upper end of the prior of the larger radius");
    visit("min_hits", self.min_hits, Bounds{3, 1000}, "", "minimum number of visible hits of a segment");
    visit("min_hidden_share", self.min_hidden_share, Bounds{0.0, 1.0}, "",
          "minimum fraction, rounded up, of the beams on the object that are occluded");
    visit("max_hidden_share", self.max_hidden_share, Bounds{0.0, 1.0}, "",
          "maximum fraction, rounded down, of the beams on the object that are occluded");
    visit("max_beyond_beams", self.max_beyond_beams, Bounds{0, 1000}, "",
          "maximum number of occluded beams beyond the occluded end, uniformly distributed");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

enum class HiddenEnd : std::uint8_t {
  kNone,
  kRight,  ///< the end of lowest azimuth
  kLeft,
};

/// Observation of one object: hits on neighbouring beams. The beams beside them are free, or, at a hidden end, blocked
/// by something nearer and free after that.
struct SegmentObservation {
  int first_beam = 0;
  std::vector<double> ranges_m;  ///< of the beams from first_beam on
  HiddenEnd hidden_end = HiddenEnd::kNone;
  int blocked_beams = 0;  ///< in a row beside the hidden end
};

/// Equally weighted draws from the posterior of the object given the observation, canonical and in the sensor's frame;
/// a circle has psi = 0.
struct EllipsePosterior {
  std::vector<Ellipse> draws;
  double effective_samples = 0.0;  ///< Kish's number of the weighted draws
};

/// Sample the posterior by importance sampling in the azimuths of the two tangents and, given those, three parameters
/// in which the inverse ranges are linear (docs/math/floor.md). Draws are added until there are `effective_samples`, or
/// 100 times as many have been tried; `count` of them are kept. The same state of `random` gives the same bits. Throws
/// std::invalid_argument if the model is invalid or cannot generate the observation.
EllipsePosterior sample_posterior(const SegmentObservation& observation, const SegmentModel& model,
                                  double effective_samples, std::size_t count, Random& random);

/// Loss of an estimate. All compare characteristic points.
enum class DetectionLoss : std::uint8_t {
  kOrdered,        ///< mean distance, m (ellipse paper, eq. 1)
  kSymmetric,      ///< the same over the better of the pairings that a rotation by pi leaves open, m
  kCircle,         ///< mean distance of two circles, axes along the sensor's, m
  kCircleSquared,  ///< mean squared distance of two circles, m^2 (circle paper, eq. 7): |dt|^2 + dr^2
};

double loss_of(DetectionLoss loss, const Ellipse& estimate, const Ellipse& truth);

/// Mean of the loss of one estimate over equally likely truths.
double expected_loss(DetectionLoss loss, const Ellipse& estimate, const std::vector<Ellipse>& truths);

/// The estimate of least expected loss over equally likely truths. It need not be canonical: to hedge between psi =
/// pi/2 and psi = -pi/2, kOrdered may have its minimum at rx < ry. Throws std::invalid_argument if there are no truths.
Ellipse bayes_estimate(DetectionLoss loss, const std::vector<Ellipse>& truths);

}  // namespace situation_awareness
