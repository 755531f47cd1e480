// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/object_map.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/assignment.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

using namespace object_error;

namespace {

constexpr int kMeasurementSize = 5;
constexpr double kMinRadiusM = 0.01;

Ellipse ellipse_world_of(const ObjectState& x) {
  return {x.position_world_m, std::arg(x.orientation_world), x.radii_m.x(), x.radii_m.y()};
}

/// True if no direction of the 2x2 block at `place` is less certain than `max_sigma` (circle paper, eq. 33; in blocks
/// of one unit each, because an eigenvector over metres and radians has no unit to compare a threshold with).
bool certain(const Matrix8d& P, int place, double max_sigma) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(P.block<2, 2>(place, place), Eigen::EigenvaluesOnly);
  return solver.eigenvalues().maxCoeff() <= max_sigma * max_sigma;
}

}  // namespace

void ObjectMapParams::validate() const { check_bounds(*this, "objects"); }

ObjectMap::ObjectMap(const ObjectMapParams& params) : params_(params) {
  params_.validate();
  gate_ = chi_square_quantile(params_.gate_probability, kMeasurementSize);
  process_noise_ = {params_.acceleration_noise, params_.angular_acceleration_noise, params_.radius_noise};
  const Eigen::Vector3d robot_sigma(params_.robot_position_sigma_m, params_.robot_position_sigma_m,
                                    params_.robot_yaw_sigma_rad);
  robot_covariance_ = robot_sigma.array().square().matrix().asDiagonal();
}

void ObjectMap::clear() { elements_.clear(); }

/// What cannot be observed must not grow without end: the axis of a circle is at worst uniform, and its turning at worst
/// as unknown as a new element's. Scaling a row and a column keeps P positive definite.
void ObjectMap::bound_unobservable(Matrix8d& P) const {
  const auto bound = [&](int place, double max_sigma) {
    const double sigma = std::sqrt(P(place, place));
    if (sigma <= max_sigma) return;
    P.row(place) *= max_sigma / sigma;
    P.col(place) *= max_sigma / sigma;
  };
  bound(kOrientation, kPi / std::sqrt(12.0));
  bound(kAngularVelocity, params_.initial_angular_velocity_sigma_rad_s);
}

void ObjectMap::predict_elements(double dt_s) {
  const Matrix8d F = process_jacobian(dt_s);
  const Matrix8d Q = process_covariance(dt_s, process_noise_);
  for (Element& element : elements_) {
    element.x = predict(element.x, dt_s);
    element.P = F * element.P * F.transpose() + Q;
    bound_unobservable(element.P);
    element.beams = 0;
  }
}

Measurement ObjectMap::measurement_of(const Detection& detection) const {
  Measurement measurement{detection.ellipse_level, detection.covariance};
  const double variance = params_.measurement_sigma_m * params_.measurement_sigma_m;
  for (const int place : {0, 1, 3, 4}) measurement.covariance(place, place) += variance;
  return measurement;
}

ObjectMapUpdate ObjectMap::update(const Detections& detections) {
  ObjectMapUpdate report;
  const bool first = stamp_ns_ == kNoStamp;
  const double dt_s = first ? 0.0 : seconds_between(stamp_ns_, detections.stamp_ns);
  if (!first && dt_s <= 0.0) {
    if (dt_s >= -params_.reset_time_jump_s) {
      ++report.reasons[dt_s == 0.0 ? "stamp repeats" : "stamp goes back"];
      return report;
    }
    for (const Element& element : elements_) report.deleted.push_back(element.id);
    ++report.reasons["time jumped back: new map"];
    clear();
  }
  stamp_ns_ = detections.stamp_ns;
  height_world_m_ = detections.height_world_m;
  const Pose2& T_world_level = detections.T_world_level;

  if (dt_s > 0.0) predict_elements(dt_s);

  // Association: detections sorted by x, so that each element looks only at those its gate can reach.
  std::vector<Measurement> measurements;
  std::vector<std::pair<double, int>> by_x;
  for (const Detection& detection : detections.detections) {
    by_x.emplace_back((T_world_level * detection.ellipse_level.center_m).x(), static_cast<int>(measurements.size()));
    measurements.push_back(measurement_of(detection));
  }
  std::sort(by_x.begin(), by_x.end());
  double widest_variance = 0.0;
  for (const Measurement& measurement : measurements) {
    widest_variance = std::max(widest_variance, measurement.covariance.topLeftCorner<2, 2>().trace());
  }

  std::vector<Candidate> candidates;
  std::vector<Match> matches;
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    const Element& element = elements_[i];
    const double lever_m = (element.x.position_world_m - T_world_level.translation_m).norm();
    const double robot_variance =
        robot_covariance_.topLeftCorner<2, 2>().trace() + lever_m * lever_m * robot_covariance_(2, 2);
    const double variance = element.P.block<2, 2>(kPosition, kPosition).trace() + robot_variance + widest_variance;
    const double reach_m = std::sqrt(gate_ * variance);
    const double x = element.x.position_world_m.x();
    auto near = std::lower_bound(by_x.begin(), by_x.end(), std::make_pair(x - reach_m, -1));
    for (; near != by_x.end() && near->first <= x + reach_m; ++near) {
      const Match candidate = match(element.x, element.P, T_world_level,
                                    measurements[static_cast<std::size_t>(near->second)], robot_covariance_);
      if (!(candidate.mahalanobis2 <= gate_)) continue;
      candidates.push_back({static_cast<int>(i), near->second, candidate.mahalanobis2 + candidate.log_det_S});
      matches.push_back(candidate);
    }
  }

  // Costs are negative log-likelihoods, shifted so that every match inside its gate is worth more than none.
  double least = 0.0;
  double most = 0.0;
  if (!candidates.empty()) {
    const auto [low, high] = std::minmax_element(candidates.begin(), candidates.end(),
                                                 [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
    least = low->cost;
    most = high->cost;
  }
  for (Candidate& candidate : candidates) candidate.cost -= least;
  const std::vector<int> detection_of = assign(static_cast<int>(elements_.size()),
                                               static_cast<int>(measurements.size()), candidates, most - least + 1.0);

  const auto evidence_of = [&](const Detection& detection) {
    return detection.hidden_end ? params_.hidden_observation_weight : 1.0;
  };
  std::vector<bool> used(measurements.size(), false);
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    const auto i = static_cast<std::size_t>(candidates[c].row);
    if (detection_of[i] != candidates[c].column) continue;
    const auto j = static_cast<std::size_t>(candidates[c].column);
    Element& element = elements_[i];
    situation_awareness::update(element.x, element.P, T_world_level, matches[c], robot_covariance_);
    element.x.radii_m = element.x.radii_m.cwiseMax(kMinRadiusM);
    make_canonical(element.x, element.P);
    element.last_seen_ns = stamp_ns_;
    element.beams = detections.detections[j].beams;
    ++element.observations;
    element.evidence += evidence_of(detections.detections[j]);
    used[j] = true;
    report.updated.push_back(element.id);
  }

  // Mapping of what is new, unless it lies on an element that has just been seen: one body in two pieces.
  const std::size_t known = elements_.size();
  for (std::size_t j = 0; j < measurements.size(); ++j) {
    if (used[j]) continue;
    const Ellipse ellipse_world = T_world_level * measurements[j].ellipse_level;
    const bool on_known = std::any_of(elements_.begin(), elements_.begin() + static_cast<std::ptrdiff_t>(known),
                                      [&](const Element& element) {
                                        return element.last_seen_ns == stamp_ns_ &&
                                               contains(ellipse_world_of(element.x), ellipse_world.center_m);
                                      });
    if (on_known) {
      ++report.reasons["detection on an element already seen"];
      continue;
    }
    Element element;
    element.id = next_id_++;
    element.x = map_measurement(measurements[j].ellipse_level, T_world_level);
    const auto G = mapping_jacobian(T_world_level);
    const auto G_u = mapping_input_jacobian(measurements[j].ellipse_level, T_world_level);
    element.P = G * measurements[j].covariance * G.transpose() + G_u * robot_covariance_ * G_u.transpose();
    element.P.diagonal().segment<2>(kVelocity).array() +=
        params_.initial_velocity_sigma_m_s * params_.initial_velocity_sigma_m_s;
    element.P(kAngularVelocity, kAngularVelocity) +=
        params_.initial_angular_velocity_sigma_rad_s * params_.initial_angular_velocity_sigma_rad_s;
    make_canonical(element.x, element.P);
    element.first_seen_ns = element.last_seen_ns = stamp_ns_;
    element.beams = detections.detections[j].beams;
    element.observations = 1;
    element.evidence = evidence_of(detections.detections[j]);
    report.created.push_back(element.id);
    elements_.push_back(element);
  }

  delete_outdated(report);
  return report;
}

/// Map management (circle paper, Sect. V-B3): what has just been seen is uncertain at worst, not outdated.
void ObjectMap::delete_outdated(ObjectMapUpdate& report) {
  const auto outdated = [&](const Element& element) -> const char* {
    if (element.last_seen_ns == stamp_ns_) return "";
    if (!certain(element.P, kPosition, params_.max_position_sigma_m)) return "position too uncertain";
    if (!certain(element.P, kVelocity, params_.max_velocity_sigma_m_s)) return "velocity too uncertain";
    if (!certain(element.P, kRadii, params_.max_radius_sigma_m)) return "radii too uncertain";
    const bool replaced = std::any_of(elements_.begin(), elements_.end(), [&](const Element& other) {
      return other.last_seen_ns == stamp_ns_ && contains(ellipse_world_of(other.x), element.x.position_world_m);
    });
    return replaced ? "another element was seen in its place" : "";
  };
  std::vector<bool> drop;
  for (const Element& element : elements_) {
    const char* reason = outdated(element);
    drop.push_back(*reason != '\0');
    if (!drop.back()) continue;
    ++report.reasons[reason];
    report.deleted.push_back(element.id);
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    if (!drop[i]) elements_[kept++] = elements_[i];
  }
  elements_.resize(kept);
}

Objects ObjectMap::at(std::int64_t stamp_ns) const {
  Objects result;
  result.stamp_ns = stamp_ns;
  result.height_world_m = height_world_m_;
  if (elements_.empty()) return result;
  const double dt_s = std::max(0.0, seconds_between(stamp_ns_, stamp_ns));
  const Matrix8d F = process_jacobian(dt_s);
  const Matrix8d Q = process_covariance(dt_s, process_noise_);
  for (const Element& element : elements_) {
    if (element.evidence < params_.min_observations) continue;
    const ObjectState x = predict(element.x, dt_s);
    Object object;
    object.id = element.id;
    object.ellipse_world = canonical(ellipse_world_of(x));
    object.velocity_world_m_s = x.velocity_world_m_s;
    object.angular_velocity_rad_s = x.angular_velocity_rad_s;
    object.covariance = F * element.P * F.transpose() + Q;
    bound_unobservable(object.covariance);
    object.first_seen_ns = element.first_seen_ns;
    object.last_seen_ns = element.last_seen_ns;
    object.observations = element.observations;
    object.beams = element.beams;
    result.objects.push_back(object);
  }
  return result;
}

}  // namespace situation_awareness
