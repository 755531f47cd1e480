// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/association.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/LU>

#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/map/objects/re_identification.hpp"

namespace situation_awareness {

using namespace object_state;

namespace {

/// Factor on max_position_sigma_m. An element less certain than that matches no detection with a hidden end, which does
/// not identify it. No source is recorded, and no unit test bounds it. In flights half of it
/// lowers the recall by 0.006 and raises the velocity RMSE of standing objects from 0.2 to 18 mm/s.
constexpr double kMaxSigmaOfPieces = 3.0;
constexpr const char* kOutsideGate = "match rejected: outside the gate";
constexpr const char* kOutOfSight = "match rejected: element out of sight";
constexpr const char* kHitsElsewhere = "match rejected: its hits are elsewhere";
/// m. The middle of the hits on an element of a certain position is at most this far outside of its outline. With half
/// of it the map of boxes has as many false elements, recordings more ids.
constexpr double kElsewhere_m = 0.2;
/// Standard deviations of the position by which the hits may be farther away. With 3 a segment beside a known thing is
/// its own for 0.7 s, not 0.6 s (freiburg_079).
constexpr double kElsewhereSigmas = 2.0;

/// A box with a hidden end may have its centre anywhere behind its hits, but not its hits; false where these are
/// not known.
bool hits_elsewhere(const MotionEstimate& estimate, const Eigen::Vector2d& middle_world_m) {
  const ObjectEstimate& likely = likelier(estimate);
  const double reach_m = kElsewhere_m + kElsewhereSigmas * position_sigma_m(likely);
  return offset_m(ellipse_world(likely.x), middle_world_m) > reach_m;
}

/// True if no detection with a hidden end identifies the element.
bool is_uncertain(const MapElement& element, const ObjectMapParams& params) {
  return published_position_sigma_m(element, params) > kMaxSigmaOfPieces * params.max_position_sigma_m;
}

/// Sum of the variances of the position along two axes.
double position_variance(const ObjectEstimate& estimate) {
  return estimate.P.block<2, 2>(kPosition, kPosition).trace();
}

double position_variance(const Measurement& measurement) { return measurement.R.topLeftCorner<2, 2>().trace(); }

/// Squared Mahalanobis distance of the position alone, which is never more than that of the whole measurement.
double position_mahalanobis2(const ObjectEstimate& estimate, const Eigen::Vector2d& center_world_m,
                             const Eigen::Matrix2d& covariance_world_m2, double offset_s, const Pose2& T_world_level,
                             const Eigen::Matrix3d& U) {
  const Eigen::Vector2d expected_m = position(estimate) + offset_s * estimate.x.segment<2>(kVelocity);
  const Eigen::Vector2d lever_m = expected_m - T_world_level.translation_m;
  Eigen::Matrix<double, 2, 4> H;
  H << Eigen::Matrix2d::Identity(), offset_s * Eigen::Matrix2d::Identity();
  Eigen::Matrix<double, 2, 3> H_u;
  H_u << Eigen::Matrix2d::Identity(), Eigen::Vector2d(-lever_m.y(), lever_m.x());
  const Eigen::Matrix2d S = H * estimate.P.block<4, 4>(kPosition, kPosition) * H.transpose() +
                            H_u * U * H_u.transpose() + covariance_world_m2;
  const Eigen::Vector2d nu = center_world_m - expected_m;
  return nu.dot(S.inverse() * nu);
}

}  // namespace

double log_detection_ratio(const ExpectedDetection& expected, double detection_probability) {
  return std::log(detection_probability) - std::log1p(-expected.probability);
}

const char* match_defect(const MapElement& element, const MotionMatch& match, double gate, bool common_shape,
                         std::int64_t stamp_ns) {
  // A lost element that stood when it was last seen is expected only where it stood: if it had moved since, it could be
  // anywhere.
  const bool stood = !element.mobile && element.estimate.p_moving < 0.5 && is_out_of_sight(element, stamp_ns);
  const bool inside = match.standing.mahalanobis2 <= gate || (!stood && match.moving.mahalanobis2 <= gate);
  if (!inside) return kOutsideGate;
  const bool anywhere = common_shape && position_sigma_m(likelier(element.estimate)) > kMaxSigmaOfCommonShape_m;
  return anywhere ? kOutOfSight : "";
}

/// Measurements sorted by x, so that each element tests only those within reach of its gate.
void Associator::sort_measurements(const AssociationInput& input) {
  by_x_.clear();
  on_seen_.clear();
  largest_variance_m2_ = longest_offset_s_ = 0.0;
  const Eigen::Matrix2d R_world_level = input.T_world_level.rotation();
  for (const Measurement& measurement : input.measurements) {
    by_x_.push_back({input.T_world_level * Eigen::Vector2d(measurement.z.head<2>()),
                     R_world_level * measurement.R.topLeftCorner<2, 2>() * R_world_level.transpose(),
                     static_cast<int>(by_x_.size())});
    on_seen_.push_back(input.recently_seen.cover(by_x_.back().center_world_m) ? 1 : 0);
    largest_variance_m2_ = std::max(largest_variance_m2_, position_variance(measurement));
    longest_offset_s_ = std::max(longest_offset_s_, std::abs(measurement.time_offset_s));
  }
  std::sort(by_x_.begin(), by_x_.end(), [](const Place& a, const Place& b) {
    return std::make_pair(a.center_world_m.x(), a.measurement) < std::make_pair(b.center_world_m.x(), b.measurement);
  });
}

void Associator::find_candidates(const AssociationInput& input, const MeasuringFrame& level, std::size_t i,
                                 const ObjectMapParams& params, double gate) {
  const MapElement& element = input.elements[i];
  const MotionEstimate& estimate = element.estimate;
  const bool out_of_sight = is_out_of_sight(element, input.stamp_ns);
  const bool stands = !element.mobile && estimate.p_moving < 0.5;

  // The reach of a gate: with the robot's errors, until the time of the measurement; of either motion, but what stood
  // when it was last seen is expected only there (match_defect).
  const bool stood = stands && out_of_sight;
  const Eigen::Vector2d center_m = position(stood ? estimate.standing : estimate.moving);
  const double lever_m = (center_m - input.T_world_level.translation_m).norm();
  const double standing_m2 = position_variance(estimate.standing);
  const double variance_m2 = (stood ? standing_m2 : std::max(standing_m2, position_variance(estimate.moving))) +
                             input.U.topLeftCorner<2, 2>().trace() + lever_m * lever_m * input.U(2, 2);
  const ObjectEstimate& fastest = stood ? estimate.standing : estimate.moving;
  const double fastest_m_s =
      fastest.x.segment<2>(kVelocity).norm() + std::sqrt(gate * fastest.P.block<2, 2>(kVelocity, kVelocity).trace());
  const double apart_m = (center_m - position(estimate.standing)).norm();
  const double reach_m =
      std::sqrt(gate * (variance_m2 + largest_variance_m2_)) + longest_offset_s_ * fastest_m_s + apart_m;

  auto near = std::lower_bound(by_x_.begin(), by_x_.end(), center_m.x() - reach_m,
                               [](const Place& place, double x_m) { return place.center_world_m.x() < x_m; });
  for (; near != by_x_.end() && near->center_world_m.x() <= center_m.x() + reach_m; ++near) {
    if (std::abs(near->center_world_m.y() - center_m.y()) > reach_m) continue;
    const auto j = static_cast<std::size_t>(near->measurement);
    const Measurement& measurement = input.measurements[j];
    Rejection& rejection = rejections_[j];
    // A detection on an element in sight belongs to it; a detection with a hidden end does not identify an uncertain
    // element.
    if ((out_of_sight && on_seen_[j] != 0) || (measurement.hidden_end && is_uncertain(element, params))) {
      if (*rejection.reason == '\0') rejection.reason = kOutOfSight;
      continue;
    }
    const auto is_out_of_reach = [&](const ObjectEstimate& of_motion) {
      return position_mahalanobis2(of_motion, near->center_world_m, near->covariance_world_m2,
                                   measurement.time_offset_s, input.T_world_level, input.U) > gate;
    };
    if (is_out_of_reach(estimate.standing) && (stood || is_out_of_reach(estimate.moving))) {
      if (*rejection.reason == '\0') rejection.reason = kOutsideGate;
      continue;
    }
    const bool may_be_aside = measurement.is_box && measurement.hidden_end && stands;
    if (may_be_aside && hits_elsewhere(estimate, input.T_world_level * measurement.middle_level_m)) {
      if (*rejection.reason == '\0') rejection.reason = kHitsElsewhere;
      continue;
    }
    const MotionMatch candidate = match(estimate, level, measurement, input.U);
    const double log_ratio = candidate.log_likelihood - kLogNewObjectDensity +
                             log_detection_ratio(input.expected[i], params.detection_probability);
    const char* defect = match_defect(element, candidate, gate, input.common_shape[i] != 0, input.stamp_ns);
    if (*defect == '\0' && !(log_ratio > 0.0)) defect = "match rejected: more probably something new";
    if (candidate.log_likelihood > rejection.log_likelihood) {
      rejection = {*defect != '\0' ? defect : "match rejected: taken by another", candidate.log_likelihood};
    }
    if (*defect != '\0') continue;
    candidates_.push_back({static_cast<int>(i), near->measurement, -log_ratio});
    matches_.push_back(candidate);
  }
}

void Associator::associate(const AssociationInput& input, const ObjectMapParams& params, double gate) {
  candidates_.clear();
  candidates_.reserve(kUsualRoom);
  matches_.clear();
  associations_.clear();
  assign_with_room(rejections_, input.measurements.size(), {});
  sort_measurements(input);
  const MeasuringFrame level(input.T_world_level);
  for (std::size_t i = 0; i < input.elements.size(); ++i) {
    if (!is_person(input.elements[i])) find_candidates(input, level, i, params, gate);
  }
  candidates_.insert(candidates_.end(), input.of_persons.begin(), input.of_persons.end());
  column_of_row_.clear();
  if (candidates_.empty()) return;

  column_of_row_ = assign(input.rows, input.columns, candidates_, std::move(column_of_row_));
  for (std::size_t c = 0; c < matches_.size(); ++c) {
    const auto element = static_cast<std::size_t>(candidates_[c].row);
    if (column_of_row_[element] != candidates_[c].column) continue;
    associations_.push_back({element, static_cast<std::size_t>(candidates_[c].column), matches_[c]});
  }
}

}  // namespace situation_awareness
