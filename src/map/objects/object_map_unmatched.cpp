// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/map/objects/object_map.hpp"
#include "situation_awareness/map/objects/shape_belief.hpp"

// What detections that are of no element tell.
namespace situation_awareness {

using namespace object_state;

namespace {

/// Probability that a new box moves: the views of its faces change, and look like motion.
constexpr double kNewBoxMoves = 0.1;
/// Factor on the variances of the velocity where the shape is corrected.
constexpr double kCorrectedVelocity = 4.0;
/// Factor on the standard deviation of the prior of a radius from which on a view tells nothing of it.
constexpr double kUnknownRadius = 2.0;

/// A detection that was refined by a known shape has no prior in it: what the view does not show is as good as unknown.
/// For a box that begins with it the prior of boxes holds.
void complete_by_prior(ObjectEstimate& estimate) {
  const double scale = 1.0 / std::sqrt(3.0);  // m = (a + b) / sqrt(3) of the half lengths a and b
  const double sigma_m = std::sqrt(2.0) * scale * box_prior::kHalfSigma_m;
  if (estimate.P(kShape, kShape) < std::pow(kUnknownRadius * sigma_m, 2)) return;
  Eigen::Matrix<double, 3, 8> H = Eigen::Matrix<double, 3, 8>::Zero();
  H.middleCols<3>(kShape).setIdentity();
  const Eigen::Matrix3d R = sigma_m * sigma_m * Eigen::Matrix3d::Identity();
  const Eigen::Vector3d mean(2.0 * scale * box_prior::kMeanHalf_m, 0.0, 0.0);
  update(estimate, innovation(estimate, Eigen::Vector3d(mean - estimate.x.segment<3>(kShape)), H, R), H, R);
}

/// The sizes that are known of a box hold for an estimate of it by one view, too, unless they contradict it: what this
/// view does not show has not changed. True if they hold.
bool complete_by_known(const ObjectEstimate& known, double psi_world_rad, ObjectEstimate& estimate) {
  constexpr double kChiSquare999 = 16.266;  // of 3 degrees of freedom
  const Eigen::Vector2d known_axis = known.x.segment<2>(kShape + 1);
  const double half_difference_m = known_axis.norm();
  if (half_difference_m < kMinRadius_m) return false;
  const Eigen::Vector2d along = known_axis / half_difference_m;
  // (m, p, q) turned so that the long side is at psi or, with the opposite sign, across it.
  Innovation<3> nearest;
  Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 8> H = Eigen::Matrix<double, 3, 8>::Zero();
  H.middleCols<3>(kShape).setIdentity();
  nearest.mahalanobis2 = std::numeric_limits<double>::infinity();
  for (const double sign : {1.0, -1.0}) {
    const Eigen::Vector2d axis = sign * Eigen::Vector2d(std::cos(2.0 * psi_world_rad), std::sin(2.0 * psi_world_rad));
    Eigen::Matrix3d T = Eigen::Matrix3d::Identity();
    T.bottomRightCorner<2, 2>() << along.dot(axis), -(along.x() * axis.y() - along.y() * axis.x()),
        along.x() * axis.y() - along.y() * axis.x(), along.dot(axis);
    const Eigen::Matrix3d R_turned = T * known.P.block<3, 3>(kShape, kShape) * T.transpose();
    const Eigen::Vector3d z(known.x(kShape), half_difference_m * axis.x(), half_difference_m * axis.y());
    const Innovation<3> turned = innovation(estimate, Eigen::Vector3d(z - estimate.x.segment<3>(kShape)), H, R_turned);
    if (turned.mahalanobis2 >= nearest.mahalanobis2) continue;
    nearest = turned;
    R = R_turned;
  }
  if (nearest.mahalanobis2 > kChiSquare999) return false;
  update(estimate, nearest, H, R);
  return true;
}

}  // namespace

/// Unmatched detections create elements, unless they overlap an element seen recently.
void ObjectMap::map_unmatched(const Detections& detections, const Eigen::Matrix3d& U, ObjectMapUpdate& report) {
  if (std::find(work_.used.begin(), work_.used.end(), 0) == work_.used.end()) return;
  work_.recently_seen = seen_within(kLostAfter_s, std::move(work_.recently_seen));
  find_unseen();
  const bool corrects_what_is_known = explains_most(detections);
  for (std::size_t j = 0; j < work_.measurements.size(); ++j) {
    if (work_.used[j] != 0) continue;
    const Measurement& measurement = work_.measurements[j];
    const Detection& detection = detections.detections[j];
    const char* const rejected = work_.associator.rejections()[j].reason;
    if (*rejected != '\0') ++report.reasons[rejected];
    if (work_.people.may_be_leg(j, elements_)) {
      ++report.reasons["leg of a person already seen"];
      continue;
    }
    MapElement* const element = element_to_reinitialize(detection, measurement, detections.T_world_level);
    if (element != nullptr && (corrects_what_is_known || element->state == TrackState::kTentative)) {
      correct(*element, detection, measurement, U, detections.T_world_level);
      observe(*element, detection, measurement, detections.T_world_level);
      confirm_if_due(static_cast<std::size_t>(element - elements_.data()), detection);
      report.updated.push_back(element->id);
      report.log_likelihood += kLogNewObjectDensity;
      ++report.reasons["element corrected"];
      continue;
    }
    // On an element that has just been seen it is a second part of the same body, or a bad view of it.
    if (work_.recently_seen.overlap(detections.T_world_level * detection.ellipse_level)) {
      ++report.reasons["detection on an element already seen"];
      continue;
    }
    if (size() >= map_bounds::kMaxElements) {
      ++report.reasons["map is full"];
      continue;
    }
    MapElement created;
    created.id = next_id_++;
    created.estimate = new_estimate(measurement, detections.T_world_level, U);
    if (detection.shape == Shape::kBox) created.estimate.p_moving = kNewBoxMoves;
    created.first_seen_ns = stamp_ns();
    observe(created, detection, measurement, detections.T_world_level);
    begin_existence(created, params_);
    if (created.state == TrackState::kConfirmed) work_.newly_confirmed.push_back(elements_.size());
    report.created.push_back(created.id);
    report.log_likelihood += kLogNewObjectDensity;
    elements_.push_back(created);
  }
}

/// The element on which an unmatched detection with two visible ends lies: two objects cannot overlap, so the element
/// was wrong (e.g. its first views were partial). Elements out of sight do not count.
MapElement* ObjectMap::element_to_reinitialize(const Detection& detection, const Measurement& measurement,
                                               const Pose2& T_world_level) {
  if (measurement.hidden_end && detection.shape != Shape::kBox) return nullptr;
  const Eigen::Vector2d center_world_m = T_world_level * Eigen::Vector2d(measurement.z.head<2>());
  const Ellipse detected_world = T_world_level * detection.ellipse_level;
  const auto is_on = [&](const Ellipse& ellipse) {
    return contains(ellipse, center_world_m) ||
           (detection.shape == Shape::kBox && contains(detected_world, ellipse.center_m));
  };
  /// m. What reaches so near may match, against rounding.
  constexpr double kRounding_m = 1e-6;
  const double reach_m = work_.largest_unseen_m + detection.ellipse_level.rx_m + kRounding_m;
  std::size_t nearest = elements_.size();
  double nearest_m = 0.0;
  auto unseen = std::lower_bound(work_.unseen.begin(), work_.unseen.end(), center_world_m.x() - reach_m,
                                 [](const Unseen& other, double x_m) { return other.x_m < x_m; });
  for (; unseen != work_.unseen.end() && unseen->x_m <= center_world_m.x() + reach_m; ++unseen) {
    const MapElement& element = elements_[unseen->element];
    if (element.last_seen_ns == stamp_ns()) continue;  // by another detection
    // What looks like a box says nothing of what is known to be none: it is more than this element.
    if (detection.log_box_ratio > 0.0 && element.box_log_odds < -kKnownShape) continue;
    const Ellipse ellipse = ellipse_world(likelier(element.estimate).x);
    if (!is_on(ellipse)) continue;
    const double distance_m = (ellipse.center_m - center_world_m).norm();
    const bool is_nearer =
        nearest == elements_.size() || distance_m < nearest_m || (distance_m == nearest_m && unseen->element < nearest);
    if (!is_nearer) continue;
    nearest = unseen->element;
    nearest_m = distance_m;
  }
  return nearest == elements_.size() ? nullptr : &elements_[nearest];
}

/// Those on which an unmatched detection may lie: in sight, but not detected in this scan.
void ObjectMap::find_unseen() {
  work_.unseen.clear();
  work_.unseen.reserve(kUsualRoom);
  work_.largest_unseen_m = 0.0;
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    const MapElement& element = elements_[i];
    if (is_person(element) || element.last_seen_ns == stamp_ns() || is_out_of_sight(element, stamp_ns())) continue;
    const Vector8d& x = likelier(element.estimate).x;
    work_.unseen.push_back({x(kPosition), i});
    work_.largest_unseen_m = std::max(work_.largest_unseen_m, x(kShape) + x.segment<2>(kShape + 1).norm());
  }
  std::sort(work_.unseen.begin(), work_.unseen.end(), [](const Unseen& a, const Unseen& b) {
    return std::make_pair(a.x_m, a.element) < std::make_pair(b.x_m, b.element);
  });
}

/// Whether known elements explain at least half of the detections. One that lies on a known element and does not match
/// it counts for the map: the element may be wrong. Where most detections are of nothing known, as in dust or after a
/// jump of the pose, a detection on a known element is as likely one of these, and says nothing against the element.
bool ObjectMap::explains_most(const Detections& detections) {
  const std::size_t all = work_.measurements.size();
  std::size_t explained = work_.of_known;
  for (std::size_t j = 0; j < all && 2 * explained < all; ++j) {
    if (work_.used[j] != 0) continue;
    const MapElement* const element =
        element_to_reinitialize(detections.detections[j], work_.measurements[j], detections.T_world_level);
    if (element != nullptr && element->state != TrackState::kTentative) ++explained;
  }
  return 2 * explained >= all;
}

/// The estimate anew from a detection. Another face of a box says nothing against its velocity.
void ObjectMap::correct(MapElement& element, const Detection& detection, const Measurement& measurement,
                        const Eigen::Matrix3d& U, const Pose2& T_world_level) const {
  if (detection.shape != Shape::kBox) {
    element.estimate = new_estimate(measurement, T_world_level, U);
    return;
  }
  ObjectEstimate mapped = map_measurement(measurement, T_world_level, U);
  const bool is_known =
      is_box(element) && params_.shape != "circle" &&
      complete_by_known(likelier(element.estimate), T_world_level.yaw_rad + detection.box_level.psi_rad, mapped);
  bound_radii(mapped.x, kMinRadius_m);
  const MotionEstimate anew = is_known ? start(mapped, motion_) : new_estimate(measurement, T_world_level, U);
  const auto keep_velocity = [](ObjectEstimate& estimate, const ObjectEstimate& other) {
    const Eigen::Vector3d velocity = estimate.x.segment<3>(kVelocity);
    const Eigen::Matrix3d P = kCorrectedVelocity * estimate.P.block<3, 3>(kVelocity, kVelocity);
    estimate = other;
    estimate.x.segment<3>(kVelocity) = velocity;
    estimate.P.block<3, 3>(kVelocity, kVelocity) = P;
  };
  keep_velocity(element.estimate.standing, anew.standing);
  keep_velocity(element.estimate.moving, anew.moving);
}

MotionEstimate ObjectMap::new_estimate(const Measurement& measurement, const Pose2& T_world_level,
                                       const Eigen::Matrix3d& U) const {
  ObjectEstimate mapped = map_measurement(measurement, T_world_level, U);
  if (measurement.is_box) complete_by_prior(mapped);
  if (params_.shape == "circle") make_circle(mapped);
  bound_radii(mapped.x, kMinRadius_m);
  return start(mapped, motion_);
}

}  // namespace situation_awareness
