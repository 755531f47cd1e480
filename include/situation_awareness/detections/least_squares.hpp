// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/detector.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// What a hit, a silhouette and an object look like: the sensor model and the prior that the least-squares fit
/// minimises and that every detection's covariance is computed from.
struct EllipseFitParams {
  double range_sigma_m = 0.01;
  double shape_sigma_m = 0.005;
  double prior_max_radius_m = 0.5;
  double mean_radius_m = 0.22;
  double mean_radius_sigma_m = 0.12;
  double radius_difference_sigma_m = 0.06;
  double min_radius_m = 0.03;
  double max_radius_m = 0.8;
  double max_residual_m = 0.06;
  int max_iterations = 15;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("range_sigma_m", self.range_sigma_m, Bounds{1e-4, 1.0}, "m", "standard deviation of the range noise");
    visit("shape_sigma_m", self.shape_sigma_m, Bounds{0.0, 1.0}, "m",
          "standard deviation of a real outline about its ellipse, added in quadrature to the range noise");
    visit("prior_max_radius_m", self.prior_max_radius_m, Bounds{0.05, 10.0}, "m",
          "scale of the network's prior of the radii, which are expected between a tenth of this and this");
    visit("mean_radius_m", self.mean_radius_m, Bounds{0.01, 10.0}, "m", "prior mean of (rx + ry) / 2");
    visit("mean_radius_sigma_m", self.mean_radius_sigma_m, Bounds{1e-3, 10.0}, "m",
          "prior standard deviation of (rx + ry) / 2");
    visit("radius_difference_sigma_m", self.radius_difference_sigma_m, Bounds{1e-3, 10.0}, "m",
          "prior standard deviation of each component of (rx - ry) / 2 (cos 2 psi, sin 2 psi)");
    visit("min_radius_m", self.min_radius_m, Bounds{1e-3, 10.0}, "m", "lower bound of a fitted radius");
    visit("max_radius_m", self.max_radius_m, Bounds{0.01, 100.0}, "m",
          "maximum radius of a detection; a larger ellipse is rejected");
    visit("max_residual_m", self.max_residual_m, Bounds{1e-3, 10.0}, "m",
          "maximum RMS distance of a segment's points from its ellipse; a detection with more is rejected", kLive);
    visit("max_iterations", self.max_iterations, Bounds{1, 1000}, "", "maximum number of Gauss-Newton iterations");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// Minimise the sensor's own model over ellipses: hits lie on the curve within the range noise, beams beside a
/// silhouette end miss it within the beam spacing, and radii follow the prior.
Detection fit_ellipse(const Segments& segments, std::size_t segment, const EllipseFitParams& params);

/// The same of an object that is known: one step of Gauss and Newton from the ellipse that it is expected to be, about
/// whose shape the prior then is. Unlike the fit's own answers, these are linear in the noise of the hits, so that a
/// filter that averages them converges to what all scans together say (an iterated Kalman filter's step).
Detection refit_ellipse(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                        const Ellipse& known_level);

/// The detection of an ellipse (t_x, t_y, m, p, q) in one segment, radii kept at or above their bound; its covariance
/// is left at zero.
Detection make_detection(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                         const Vector5d& smooth_level);

/// The detection that `ellipse_level` is, found by whatever means: its residual and, by the curvature of the same
/// model at it (Laplace), its covariance.
Detection assess_ellipse(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                         const Ellipse& ellipse_level);

/// Why a detection is not to be trusted at all: empty text if it can be; first of all, if it is none.
const char* detection_defect(const Detection& detection, const EllipseFitParams& params);

/// Detects by `fit_ellipse`: needs no model file.
class LeastSquaresDetector final : public Detector {
 public:
  /// Throws std::invalid_argument naming field and bound.
  explicit LeastSquaresDetector(const EllipseFitParams& params);

  void set_fit(const EllipseFitParams& fit) override { params_ = fit; }

 private:
  void find(const Segments& segments, Detections& found) override;

  EllipseFitParams params_;
};

}  // namespace situation_awareness
