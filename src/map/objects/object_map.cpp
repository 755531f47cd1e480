// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/object_map.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Eigenvalues>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/assignment.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/ellipses_by_x.hpp"

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

ObjectMap::ObjectMap(const ObjectMapParams& params) : params_(params), order_(params.reset_time_jump_s) {
  params_.validate();
  gate_ = chi_square_quantile(params_.gate_probability, kMeasurementSize);
  process_noise_ = {params_.acceleration_noise, params_.angular_acceleration_noise, params_.radius_noise};
  const Eigen::Vector3d robot_sigma(params_.robot_position_sigma_m, params_.robot_position_sigma_m,
                                    params_.robot_yaw_sigma_rad);
  robot_covariance_ = robot_sigma.array().square().matrix().asDiagonal();
}

/// What cannot be observed must not grow without end: the axis of a circle is at worst uniform, and its turning at
/// worst as unknown as a new element's. Scaling a row and a column keeps P positive definite.
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
  Measurement measurement{detection.ellipse_level, ellipse_covariance(detection.ellipse_level, detection.covariance)};
  if (detection.hidden_end) measurement.covariance *= params_.hidden_end_factor * params_.hidden_end_factor;
  const double variance = params_.measurement_sigma_m * params_.measurement_sigma_m;
  for (const int place : {0, 1, 3, 4}) measurement.covariance(place, place) += variance;
  return measurement;
}

ObjectMapUpdate ObjectMap::update(const Detections& detections) {
  ObjectMapUpdate report;
  if (!advance_to(detections.stamp_ns, report)) return report;
  height_world_m_ = detections.height_world_m;

  std::vector<Measurement> measurements;
  for (const Detection& detection : detections.detections) measurements.push_back(measurement_of(detection));

  std::vector<bool> used(measurements.size(), false);
  for (const Association& association : associate(measurements, detections.T_world_level)) {
    Element& element = elements_[association.element];
    situation_awareness::update(element.x, element.P, detections.T_world_level, association.match, robot_covariance_);
    element.x.radii_m = element.x.radii_m.cwiseMax(kMinRadiusM);
    make_canonical(element.x, element.P);
    observe(element, detections.detections[association.measurement]);
    used[association.measurement] = true;
    report.updated.push_back(element.id);
  }

  const EllipsesByX seen = seen_now();
  for (std::size_t j = 0; j < measurements.size(); ++j) {
    if (used[j]) continue;
    // On an element that has just been seen it is a second piece of the same body.
    if (seen.cover(detections.T_world_level * measurements[j].ellipse_level.center_m)) {
      ++report.reasons["detection on an element already seen"];
      continue;
    }
    Element element = new_element(measurements[j], detections.T_world_level);
    observe(element, detections.detections[j]);
    report.created.push_back(element.id);
    elements_.push_back(element);
  }

  delete_outdated(report);
  return report;
}

bool ObjectMap::advance_to(std::int64_t stamp_ns, ObjectMapUpdate& report) {
  const std::int64_t previous_ns = order_.latest_ns();
  switch (order_.judge(stamp_ns)) {
    case StampOrder::Verdict::kNext:
      if (previous_ns != kNoStamp) predict_elements(seconds_between(previous_ns, stamp_ns));
      return true;
    case StampOrder::Verdict::kRefused:
      ++report.reasons[stamp_ns == previous_ns ? "stamp repeats" : "stamp goes back"];
      return false;
    case StampOrder::Verdict::kRestart:
      for (const Element& element : elements_) report.deleted.push_back(element.id);
      ++report.reasons["time jumped back: new map"];
      elements_.clear();
      return true;
  }
  return false;
}

std::vector<ObjectMap::Association> ObjectMap::associate(const std::vector<Measurement>& measurements,
                                                         const Pose2& T_world_level) const {
  // Measurements sorted by x, so that each element looks only at those that its gate can reach.
  struct Place {
    Eigen::Vector2d center_world_m;
    int measurement;
  };
  std::vector<Place> by_x;
  double widest_variance = 0.0;
  for (const Measurement& measurement : measurements) {
    by_x.push_back({T_world_level * measurement.ellipse_level.center_m, static_cast<int>(by_x.size())});
    widest_variance = std::max(widest_variance, measurement.covariance.topLeftCorner<2, 2>().trace());
  }
  std::sort(by_x.begin(), by_x.end(), [](const Place& a, const Place& b) {
    return std::make_pair(a.center_world_m.x(), a.measurement) < std::make_pair(b.center_world_m.x(), b.measurement);
  });

  std::vector<Candidate> candidates;
  std::vector<Match> matches;  // of the candidates
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    const Element& element = elements_[i];
    const Eigen::Vector2d& center_m = element.x.position_world_m;
    const double lever_m = (center_m - T_world_level.translation_m).norm();
    const double robot_variance =
        robot_covariance_.topLeftCorner<2, 2>().trace() + lever_m * lever_m * robot_covariance_(2, 2);
    const double variance = element.P.block<2, 2>(kPosition, kPosition).trace() + robot_variance + widest_variance;
    const double reach_m = std::sqrt(gate_ * variance);
    auto near = std::lower_bound(by_x.begin(), by_x.end(), center_m.x() - reach_m,
                                 [](const Place& place, double x_m) { return place.center_world_m.x() < x_m; });
    for (; near != by_x.end() && near->center_world_m.x() <= center_m.x() + reach_m; ++near) {
      if (std::abs(near->center_world_m.y() - center_m.y()) > reach_m) continue;
      const Measurement& measurement = measurements[static_cast<std::size_t>(near->measurement)];
      const Match candidate = match(element.x, element.P, T_world_level, measurement, robot_covariance_);
      if (!(candidate.mahalanobis2 <= gate_)) continue;
      candidates.push_back({static_cast<int>(i), near->measurement, candidate.mahalanobis2 + candidate.log_det_S});
      matches.push_back(candidate);
    }
  }
  if (candidates.empty()) return {};

  // Costs are negative log-likelihoods, shifted so that every match inside its gate is worth more than none.
  const auto [least, most] = std::minmax_element(
      candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
  const double shift = least->cost;
  const double cost_unmatched = most->cost - shift + 1.0;
  for (Candidate& candidate : candidates) candidate.cost -= shift;
  const std::vector<int> measurement_of_element =
      assign(static_cast<int>(elements_.size()), static_cast<int>(measurements.size()), candidates, cost_unmatched);

  std::vector<Association> associations;
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    const auto element = static_cast<std::size_t>(candidates[c].row);
    if (measurement_of_element[element] != candidates[c].column) continue;
    associations.push_back({element, static_cast<std::size_t>(candidates[c].column), matches[c]});
  }
  return associations;
}

ObjectMap::Element ObjectMap::new_element(const Measurement& measurement, const Pose2& T_world_level) {
  Element element;
  element.id = next_id_++;
  element.x = map_measurement(measurement.ellipse_level, T_world_level);
  const auto G = mapping_jacobian(T_world_level);
  const auto G_u = mapping_input_jacobian(measurement.ellipse_level, T_world_level);
  element.P = G * measurement.covariance * G.transpose() + G_u * robot_covariance_ * G_u.transpose();
  element.P.diagonal().segment<2>(kVelocity).array() += std::pow(params_.initial_velocity_sigma_m_s, 2);
  element.P(kAngularVelocity, kAngularVelocity) += std::pow(params_.initial_angular_velocity_sigma_rad_s, 2);
  make_canonical(element.x, element.P);
  element.first_seen_ns = stamp_ns();
  return element;
}

void ObjectMap::observe(Element& element, const Detection& detection) const {
  element.last_seen_ns = stamp_ns();
  element.beams = detection.beams;
  ++element.observations;
  element.evidence += detection.hidden_end ? params_.hidden_observation_weight : 1.0;
}

EllipsesByX ObjectMap::seen_now() const {
  std::vector<Ellipse> ellipses;
  for (const Element& element : elements_) {
    if (element.last_seen_ns == stamp_ns()) ellipses.push_back(ellipse_world_of(element.x));
  }
  return EllipsesByX(std::move(ellipses));
}

/// Map management (circle paper, Sect. V-B3): what has just been seen is uncertain at worst, not outdated.
void ObjectMap::delete_outdated(ObjectMapUpdate& report) {
  const EllipsesByX seen = seen_now();
  const auto outdated = [&](const Element& element) -> const char* {
    if (element.last_seen_ns == stamp_ns()) return "";
    if (!certain(element.P, kPosition, params_.max_position_sigma_m)) return "position too uncertain";
    if (!certain(element.P, kVelocity, params_.max_velocity_sigma_m_s)) return "velocity too uncertain";
    if (!certain(element.P, kRadii, params_.max_radius_sigma_m)) return "radii too uncertain";
    if (seen.cover(element.x.position_world_m)) return "another element was seen in its place";
    return "";
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
  const double dt_s = std::max(0.0, seconds_between(order_.latest_ns(), stamp_ns));
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
