// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/shape_belief.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/objects/existence.hpp"
#include "situation_awareness/map/objects/object_filter.hpp"

namespace situation_awareness {

using namespace object_state;

namespace {

// No source but the two recordings of a car (docs/math/boxes.md) and the tests.

/// Part of the evidence of one scan that is independent of the scan before.
constexpr double kEvidence = 0.3;
/// Bound of the evidence of one scan.
constexpr double kMaxEvidence = 2.0;
/// Bound of the belief: it may change within a second.
constexpr double kMaxBoxLogOdds = 5.0;
/// How often the evidence of a view is believed that repeats for ever.
constexpr double kRepeated = 1.0;
/// (rx - ry) / (rx + ry) from which on the ellipse gives the orientation of the box; else the latest detection does,
/// and the ellipse which of its axes is the longer one.
constexpr double kLongBox = 0.1;
/// m. Bound of the standard deviation of errors that repeat from the same viewpoint: that of the mean radius before it
/// was seen (EllipseFitParams). Without a bound, views of few hits on what is known take it off the map.
constexpr double kMaxViewSigma_m = 0.12;
/// m. The same of a box, whose faces are seen in turn.
constexpr double kMaxViewSigmaOfBox_m = 0.05;

/// The estimate of the box with this ellipse as its face: its half depth d is that of the prior, and the centre lies
/// behind the face by d. g is the derivative of the state by d.
void extend_behind_face(ObjectEstimate& estimate, const Pose2& T_world_level) {
  const Eigen::Vector2d u = (position(estimate) - T_world_level.translation_m).normalized();
  const double half_depth_m = 0.5 * std::sqrt(3.0) * half_width_m(ellipse_world(estimate.x), u);
  Vector8d g = Vector8d::Zero();
  g.segment<2>(kPosition) = u;
  g.segment<3>(kShape) << 1.0, u.x() * u.x() - u.y() * u.y(), 2.0 * u.x() * u.y();
  g.segment<3>(kShape) /= std::sqrt(3.0);
  estimate.x += std::max(0.0, box_prior::kMeanHalf_m - half_depth_m) * g;
  estimate.P += box_prior::kHalfSigma_m * box_prior::kHalfSigma_m * g * g.transpose();
}

/// Views repeat, and so does their evidence: alone it is believed up to kRepeated times, and a view that tells little
/// does not overturn what a better one has told.
void add_evidence(double log_ratio, double& log_odds) {
  if (log_ratio * log_odds < 0.0 && kRepeated * std::abs(log_ratio) < std::abs(log_odds)) return;
  const double evidence = std::clamp(kEvidence * log_ratio, -kMaxEvidence, kMaxEvidence);
  const double most = std::min(kRepeated * std::abs(log_ratio), kMaxBoxLogOdds);
  const double sum = log_odds + evidence;
  if (std::abs(sum) <= most || std::abs(sum) < std::abs(log_odds)) {
    log_odds = sum;
  } else if (std::abs(log_odds) < most) {
    log_odds = std::copysign(most, sum);
  }
}

}  // namespace

void shape_update(MapElement& element, const Detection& detection, const Pose2& T_world_level) {
  if (detection.log_box_ratio <= kSurelyEllipse) return;
  const bool was_box = is_box(element);
  if (element.observations == 0 || element.box_log_odds <= kSurelyEllipse) {
    element.box_log_odds = std::clamp(detection.log_box_ratio, -kMaxBoxLogOdds, kMaxBoxLogOdds);
  } else {
    add_evidence(detection.log_box_ratio, element.box_log_odds);
  }
  if (detection.shape == Shape::kBox) element.box_psi_rad = T_world_level.yaw_rad + detection.box_level.psi_rad;
  if (element.observations == 0 || was_box || !is_box(element) || detection.shape == Shape::kBox) return;
  extend_behind_face(element.estimate.standing, T_world_level);
  extend_behind_face(element.estimate.moving, T_world_level);
}

Matrix5d view_covariance(const Detection& detection, const Matrix5d& R) {
  if (detection.shape == Shape::kBox) {
    return (R.inverse() + Matrix5d::Identity() / (kMaxViewSigmaOfBox_m * kMaxViewSigmaOfBox_m)).inverse();
  }
  const double most_m2 = kMaxViewSigma_m * kMaxViewSigma_m;
  if (R.trace() <= most_m2) return R;
  const Eigen::SelfAdjointEigenSolver<Matrix5d> axes(R);
  return axes.eigenvectors() * axes.eigenvalues().cwiseMin(most_m2).asDiagonal() * axes.eigenvectors().transpose();
}

void fill_shape(const MapElement& element, Object& object) {
  const double p_box = probability(element.box_log_odds);
  object.shape = is_box(element) ? Shape::kBox : Shape::kEllipse;
  object.p_shape = std::max(p_box, 1.0 - p_box);
  object.box_world = moment_equal_box(object.ellipse_world);
  const Ellipse& ellipse = object.ellipse_world;
  const bool is_long = ellipse.rx_m - ellipse.ry_m > kLongBox * (ellipse.rx_m + ellipse.ry_m);
  if (!is_long) object.box_world.psi_rad = nearest_axis(element.box_psi_rad, ellipse.psi_rad);
}

}  // namespace situation_awareness
