// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/evaluation/ellipse_posterior.hpp"

namespace situation_awareness {

/// The objects of the synthetic segments `boxes` and `faces`: rectangles with the centre uniform over the sensor's
/// disc, the orientation and both sides uniform. What is kept of them, and the scanner, are those of a SegmentModel.
struct BoxPrior {
  double min_side_m = 0.1;
  double max_side_m = 1.5;
  bool one_face = false;  ///< only those of which the sensor sees one face

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("min_side_m", self.min_side_m, Bounds{1e-3, 100.0}, "m", "lower end of the prior of both sides");
    visit("max_side_m", self.max_side_m, Bounds{1e-3, 100.0}, "m", "upper end of the prior of both sides");
    visit("one_face", self.one_face, "", "only those of which the sensor sees one face");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// Sample the posterior of the box given the observation, which has no hidden end, by importance sampling
/// (docs/math/floor.md, "Boxes"): the draws are the moment-equal ellipses of boxes. Arguments and exceptions as for
/// sample_posterior; of the model shape, radii and occluder do not matter.
EllipsePosterior sample_box_posterior(const SegmentObservation& observation, const SegmentModel& model,
                                      const BoxPrior& prior, double effective_samples, std::size_t count,
                                      Random& random);

}  // namespace situation_awareness
