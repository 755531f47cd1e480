// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/random.hpp"
#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/detector.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/evaluation/dogleg.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// The ellipse paper's baseline, random sample consensus (Sect. VI-C); the paper does not print its parameters. On
/// 5,000 ellipses drawn as the paper's data set 10, 50 and 200 candidates give a mean loss of 0.373,
/// 0.363 and 0.357 m (0.370 is printed).
struct RansacParams {
  double inlier_distance_m = 0.03;
  int max_candidates = 50;
  int seed = 1;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("inlier_distance_m", self.inlier_distance_m, Bounds{1e-4, 10.0}, "m",
          "maximum distance of an inlier from the candidate's curve");
    visit("max_candidates", self.max_candidates, Bounds{1, 100000}, "",
          "maximum number of candidates; a candidate with all points as inliers ends the search");
    visit("seed", self.seed, Bounds{0, 2147483647}, "", "seed of the random choice of points");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// Result of fit_ransac.
struct RansacFit {
  DoglegFit refined;                 ///< on the inliers
  std::vector<std::size_t> inliers;  ///< of the best candidate, ascending indices of the points
};

/// The candidate with most inliers (the first of several), each candidate the `fit_dogleg` of three different points
/// drawn by `random`, and then the `fit_dogleg` of its inliers. Three points do not determine five parameters: the rest
/// depends on the start of the fit. `points_level_m` holds one finite point at least; up to three points are the only
/// candidate.
RansacFit fit_ransac(const std::vector<Eigen::Vector2d>& points_level_m, const RansacParams& params,
                     const DoglegParams& dogleg_params, Random& random);

/// Detects by `fit_ransac`: a baseline (Table V of the ellipse paper, "RANSAC"). The answer for a segment depends on
/// its points and the seed alone, not on the segments before it.
class RansacDetector final : public Detector {
 public:
  /// Throws std::invalid_argument naming field and bound.
  RansacDetector(const RansacParams& params, const DoglegParams& dogleg_params, const EllipseFitParams& fit_params);

  void set_fit(const EllipseFitParams& fit) override { fit_params_ = fit; }

 private:
  void find(const Segments& segments, Detections& found) override;

  RansacParams params_;
  DoglegParams dogleg_params_;
  EllipseFitParams fit_params_;
  std::vector<Eigen::Vector2d> points_level_m_;  ///< of one segment, kept for its memory
};

}  // namespace situation_awareness
