// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/detector.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Sensor model of hits and silhouettes, and prior of the object: the cost of the least-squares fit, from which every
/// detection's covariance is computed.
struct EllipseFitParams {
  double range_sigma_m = 0.01;
  double prior_max_radius_m = 0.5;
  double mean_radius_m = 0.22;
  double radius_difference_sigma_m = 0.06;
  double max_radius_m = 0.9;
  double max_residual_m = 0.06;

  // Constants of the method, which are not read from YAML.
  /// Standard deviation of a real outline about its ellipse, added in quadrature to the range noise.
  double shape_sigma_m = 0.005;
  /// Lower bound of a fitted radius.
  double min_radius_m = 0.03;
  /// Maximum number of Gauss-Newton iterations.
  int max_iterations = 15;
  /// Prior standard deviation of (rx + ry) / 2.
  double mean_radius_sigma_m = 0.12;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("range_sigma_m", self.range_sigma_m, Bounds{1e-4, 1.0}, "m", "standard deviation of the range noise");
    visit("prior_max_radius_m", self.prior_max_radius_m, Bounds{0.05, 10.0}, "m",
          "scale of the network's prior of the radii, which are expected between a tenth of this and this");
    visit("mean_radius_m", self.mean_radius_m, Bounds{0.01, 10.0}, "m", "prior mean of (rx + ry) / 2");
    visit("radius_difference_sigma_m", self.radius_difference_sigma_m, Bounds{1e-3, 10.0}, "m",
          "prior standard deviation of each component of (rx - ry) / 2 (cos 2 psi, sin 2 psi)");
    visit("max_radius_m", self.max_radius_m, Bounds{0.01, 100.0}, "m",
          "maximum radius of a detection; a larger ellipse is rejected");
    visit("max_residual_m", self.max_residual_m, Bounds{1e-3, 10.0}, "m",
          "maximum RMS distance of a segment's points from its ellipse; a detection with more is rejected", kLive);
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// Minimise the cost of the sensor model over ellipses: hits lie on the curve within the range noise, beams beside a
/// silhouette end miss it within the beam spacing, and radii follow the prior.
Detection fit_ellipse(const Segments& segments, std::size_t segment, const EllipseFitParams& params);

/// The same for a known object: one Gauss-Newton step from the predicted ellipse, with a prior about its shape. Unlike
/// the fit, this is linear in the noise of the hits, so that a filter over many scans converges to the estimate from
/// all their hits (a step of an iterated Kalman filter).
Detection refit_ellipse(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                        const Ellipse& known_level);

/// The detection of an ellipse (t_x, t_y, m, p, q) in one segment, radii kept at or above their bound; its covariance
/// is left at zero.
Detection make_detection(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                         const Vector5d& smooth_level);

/// The detection as make_detection gives it, but without its residual.
Detection unassessed_detection(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                               const Vector5d& smooth_level);

/// The detection of `ellipse_level`, from any estimator: its residual, and its covariance from the Hessian of the same
/// cost (Laplace approximation).
Detection assess_ellipse(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                         const Ellipse& ellipse_level);

/// Twice the negative log-likelihood of hits and silhouettes for an ellipse, up to a constant; outlying hits count up
/// to a bound.
double ellipse_cost(const Segments& segments, std::size_t segment, const EllipseFitParams& params,
                    const Ellipse& ellipse_level);

/// Reason why a detection is untrustworthy or invalid; empty if it is valid.
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
