// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/detections.hpp"

#include <cmath>

#include <Eigen/Cholesky>

namespace situation_awareness {
namespace {

bool is_usable(const Matrix5d& covariance) {
  constexpr double kRounding = 1e-9;
  const Eigen::Array<double, 5, 1> sigma_m = covariance.diagonal().array().sqrt();
  if (!(sigma_m > 0.0).all() || !(sigma_m <= kMaxDetectionSigma_m).all()) return false;
  const Matrix5d correlations = (covariance.array().colwise() / sigma_m).rowwise() / sigma_m.transpose();
  if (!((correlations - correlations.transpose()).array().abs() <= kRounding).all()) return false;
  return Eigen::LLT<Matrix5d>(correlations - kRounding * Matrix5d::Identity()).info() == Eigen::Success;
}

bool is_finite(const Box& box) {
  return box.center_m.allFinite() && std::isfinite(box.psi_rad + box.half_length_m + box.half_width_m);
}

}  // namespace

const char* detection_defect(const Detection& detection) {
  const Ellipse& ellipse = detection.ellipse_level;
  const bool finite = ellipse.center_m.allFinite() && std::isfinite(ellipse.psi_rad) && std::isfinite(ellipse.rx_m) &&
                      std::isfinite(ellipse.ry_m) && std::isfinite(detection.residual_rms_m) &&
                      std::isfinite(detection.time_offset_s) && detection.covariance.allFinite();
  if (!finite || !is_finite(detection.box_level) || std::isnan(detection.log_box_ratio)) {
    return detection_refusal::kNotFinite;
  }
  if (!(ellipse.rx_m >= ellipse.ry_m && ellipse.ry_m > 0.0)) return detection_refusal::kBadRadii;
  if (!(detection.p_ellipse >= 0.0 && detection.p_ellipse <= 1.0)) return detection_refusal::kBadProbability;
  if (!is_usable(detection.covariance)) return detection_refusal::kBadCovariance;
  return "";
}

}  // namespace situation_awareness
