// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/object_map.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/Eigenvalues>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/estimation/assignment.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/objects/visibility.hpp"

namespace situation_awareness {

using namespace object_state;

namespace {

constexpr double kMinRadius_m = 0.01;
/// How long an acceleration lasts: with the standard deviation s of an exponentially correlated one, the spectral
/// density of the white one that moves an object as far is s sqrt(2 tau) (Singer, 1970).
constexpr double kManoeuvre_s = 0.5;
/// Natural logarithm of how many objects appear per scan, square metre and cubic metre of (m, p, q): one in 10,000
/// scans on each square metre, with shapes as the detectors expect them.
constexpr double kLogNewObjectDensity = -4.4;
/// What each whole detection adds to the logarithmic odds of existence: a true object is detected where it is expected
/// so much more often than something that is none.
const double kLogOddsOfDetection = std::log(4.0);
constexpr double kMaxLogOdds = 6.9;        // p = 0.999: so much doubt is always possible
constexpr double kMissedWhereHit = 0.1;    // part of detection_probability where something else may be in its place
constexpr double kSightMargin_m = 0.1;     // beams that end nearer to the outline than this end on it
constexpr double kMaxUnconfirmed_s = 1.0;  // a guess is not kept longer unseen
constexpr double kViewForgetting = 0.02;   // per scan
constexpr double kNoiseGain = 0.03;        // per detection
constexpr double kMaxNoise = 10.0;
constexpr double kAlike_m = 0.01;       // shapes that differ by less are no means of telling objects apart
constexpr int kCommon = 3;              // objects that look like another
constexpr double kCommonReach_m = 1.2;  // how uncertain the place of such an object may be if it is to be known again
constexpr double kUndecided = 0.1;
constexpr double kLost = 3.0;  // times max_position_sigma_m: a piece of something is not taken for what may be that far
constexpr double kRecently_s = 0.5;
constexpr double kSettling_s = 0.7;  // what has stood for longer is less and less likely to be a mover at rest
constexpr double kStoodLong_s = 1.5;
constexpr double kSurelyMoves = 0.95;
constexpr double kTravel_m = 0.25;  // an object that has surely moved this far may do so again
constexpr const char* kOutOfSight = "match rejected: element out of sight";

double log_odds(double p) { return std::log(p / (1.0 - p)); }

Eigen::Vector2d position(const ObjectEstimate& estimate) { return estimate.x.segment<2>(kPosition); }

/// The more probable of the two motions.
const ObjectEstimate& likelier(const MotionEstimate& estimate) {
  return estimate.p_moving > 0.5 ? estimate.moving : estimate.standing;
}

/// Sum of the variances of the position along two axes.
double position_variance(const ObjectEstimate& estimate) {
  return estimate.P.block<2, 2>(kPosition, kPosition).trace();
}

/// Standard deviation of the position in its least certain direction.
double position_sigma_m(const ObjectEstimate& estimate) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(estimate.P.block<2, 2>(kPosition, kPosition), Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues().maxCoeff()));
}

/// Distance between the outlines of two ellipses along the line of their centres; negative if they overlap.
double gap_m(const Ellipse& a, const Ellipse& b) {
  const Eigen::Vector2d d = b.center_m - a.center_m;
  const double distance_m = d.norm();
  if (distance_m < 1e-9) return -(a.rx_m + b.rx_m);
  const Eigen::Vector2d n = d / distance_m;
  return distance_m - half_width_m(a, n) - half_width_m(b, n);
}

}  // namespace

void ObjectMapParams::validate() const {
  check_bounds(*this, "objects");
  if (shape != "ellipse" && shape != "circle") {
    throw std::invalid_argument("objects.shape = " + shape + " is unknown, known are: circle, ellipse");
  }
}

ObjectMap::ObjectMap(const ObjectMapParams& params) : params_(params), order_(params.reset_time_jump_s) {
  set_params(params);
}

void ObjectMap::set_params(const ObjectMapParams& params) {
  params.validate();
  if (params.shape != params_.shape) {
    throw std::invalid_argument("objects.shape = " + params.shape + ", but this map is one of the shape " +
                                params_.shape);
  }
  params_ = params;
  order_.set_reset_time_jump_s(params_.reset_time_jump_s);
  gate_ = chi_square_quantile(params_.gate_probability, kMeasurementSize);
  const bool circle = params_.shape == "circle";
  const double density = std::sqrt(2.0 * kManoeuvre_s);
  motion_.moving.acceleration = density * params_.acceleration_sigma_m_s2;
  motion_.moving.angular_acceleration = circle ? 0.0 : density * params_.angular_acceleration_sigma_rad_s2;
  motion_.moving.mean_radius = params_.radius_drift_m;
  motion_.moving.radius_difference = circle ? 0.0 : params_.radius_drift_m;
  motion_.standing = motion_.moving;
  motion_.standing.acceleration = motion_.standing.angular_acceleration = 0.0;
  motion_.standing.position = params_.standing_drift_m;
  motion_.start_rate_1_s = params_.start_rate_1_s;
  motion_.stop_rate_1_s = params_.stop_rate_1_s;
  motion_.start_velocity_sigma = params_.start_velocity_sigma_m_s;
  motion_.start_angular_velocity_sigma = circle ? 0.0 : params_.start_angular_velocity_sigma_rad_s;
}

/// U: what is not known of the level frame's pose. An error of the stamps shifts it along its own motion.
Eigen::Matrix3d ObjectMap::robot_covariance(const Detections& detections) {
  const Eigen::Vector3d sigma(params_.robot_position_sigma_m, params_.robot_position_sigma_m,
                              params_.robot_yaw_sigma_rad);
  Eigen::Matrix3d U = sigma.array().square().matrix().asDiagonal();
  if (step_s_ > 0.0) {
    Eigen::Vector3d shift;
    shift << detections.T_world_level.translation_m - T_world_level_.translation_m,
        wrap_to_pi(detections.T_world_level.yaw_rad - T_world_level_.yaw_rad);
    shift *= params_.robot_stamp_sigma_s / step_s_;
    U += shift * shift.transpose();
  }
  T_world_level_ = detections.T_world_level;
  return U;
}

/// What has moved may well set off again, and so may what has not been seen to stand for long. Out of sight, what stood
/// is expected where it stood and what moved where its way leads, and no other ways are thought up.
MotionParams ObjectMap::motion_of(const Element& element) const {
  MotionParams motion = motion_;
  if (unseen_s(element) > kRecently_s) motion.start_rate_1_s = motion.stop_rate_1_s = 0.0;
  const bool settled = !element.mobile && element.stood_s > kStoodLong_s;
  const double unsettled = settled ? 0.0 : element.mobile ? 1.0 : std::exp(-element.stood_s / kSettling_s);
  motion.start_rate_1_s += unsettled * (params_.restart_rate_1_s - motion.start_rate_1_s);
  return motion;
}

/// What the map takes a detection's errors for.
Measurement ObjectMap::widened(const Detection& detection) const {
  Measurement measurement = measurement_of(detection);
  measurement.R *= noise_;
  if (detection.hidden_end) measurement.R *= params_.hidden_end_factor * params_.hidden_end_factor;
  measurement.R.diagonal().array() += params_.measurement_sigma_m * params_.measurement_sigma_m;
  return measurement;
}

/// Innovations tell how true the detections' covariances are (Mehra, 1970). They are never taken for too large: what is
/// too certain does harm.
void ObjectMap::learn_noise(double mahalanobis2) {
  noise_ = std::clamp(noise_ * (1.0 + kNoiseGain * (mahalanobis2 / kMeasurementSize - 1.0)), 1.0, kMaxNoise);
}

ObjectMapUpdate ObjectMap::update(const Detections& detections, ObjectMapUpdate memory) {
  ObjectMapUpdate report = std::move(memory);
  report.updated.clear();
  report.created.clear();
  report.deleted.clear();
  report.reasons.reset();
  report.matches = 0;
  report.mahalanobis2 = 0.0;
  report.log_likelihood = 0.0;
  if (!advance_to(detections.stamp_ns, report)) return report;
  height_world_m_ = detections.height_world_m;
  const Eigen::Matrix3d U = robot_covariance(detections);

  std::vector<Measurement>& measurements = work_.measurements;
  measurements.clear();
  for (const Detection& detection : detections.detections) measurements.push_back(widened(detection));

  compare_shapes();
  work_.used.assign(measurements.size(), 0);
  expect_detections(detections);
  associate(detections.T_world_level, U);
  for (const Association& association : work_.associations) {
    Element& element = elements_[association.element];
    situation_awareness::update(element.estimate, detections.T_world_level, measurements[association.measurement],
                                association.match, U);
    bound_radii(element.estimate.standing.x, kMinRadius_m);
    bound_radii(element.estimate.moving.x, kMinRadius_m);
    const double mahalanobis2 =
        (element.estimate.p_moving < 0.5 ? association.match.standing : association.match.moving).mahalanobis2;
    learn_noise(mahalanobis2);
    ++report.matches;
    report.mahalanobis2 += mahalanobis2;
    observe(element, detections.detections[association.measurement], measurements[association.measurement],
            detections.T_world_level);
    work_.used[association.measurement] = 1;
    report.updated.push_back(element.id);
    report.log_likelihood += association.match.log_likelihood;
  }
  missed_detection_update();

  work_.seen_lately = seen_within(kRecently_s, std::move(work_.seen_lately));
  for (std::size_t j = 0; j < measurements.size(); ++j) {
    if (work_.used[j] != 0) continue;
    if (*work_.rejections[j].reason != '\0') ++report.reasons[work_.rejections[j].reason];
    if (Element* const element = in_the_place_of(measurements[j], detections.T_world_level)) {
      element->estimate = new_estimate(measurements[j], detections.T_world_level, U);
      observe(*element, detections.detections[j], measurements[j], detections.T_world_level);
      report.updated.push_back(element->id);
      report.log_likelihood += kLogNewObjectDensity;
      ++report.reasons["element corrected"];
      continue;
    }
    // On an element that has just been seen it is a second piece of the same body, or the whole of it badly seen.
    if (work_.seen_lately.overlap(detections.T_world_level * detections.detections[j].ellipse_level)) {
      ++report.reasons["detection on an element already seen"];
      continue;
    }
    Element element = new_element(measurements[j], detections.T_world_level, U);
    observe(element, detections.detections[j], measurements[j], detections.T_world_level);
    element.log_odds = log_odds(params_.birth_probability);
    element.confirmed = element.just_confirmed = element.log_odds >= log_odds(params_.confirmation_probability);
    report.created.push_back(element.id);
    report.log_likelihood += kLogNewObjectDensity;
    elements_.push_back(element);
  }

  recognise_lost();
  join_parts();
  delete_outdated(report);
  return report;
}

bool ObjectMap::advance_to(std::int64_t stamp_ns, ObjectMapUpdate& report) {
  if (resumed_) {
    move_stamps_to(stamp_ns);
    resumed_ = false;
    step_s_ = 0.0;
    for (Element& element : elements_) element.beams = 0;
    return true;
  }
  const std::int64_t previous_ns = order_.latest_ns();
  switch (order_.judge(stamp_ns)) {
    case StampOrder::Verdict::kNext:
      step_s_ = previous_ns != kNoStamp ? seconds_between(previous_ns, stamp_ns) : 0.0;
      for (Element& element : elements_) {
        predict(element.estimate, step_s_, motion_of(element));
        element.beams = 0;
        element.just_confirmed = false;
      }
      return true;
    case StampOrder::Verdict::kRefused:
      ++report.reasons[stamp_ns == previous_ns ? "stamp repeats" : "stamp goes back"];
      return false;
    case StampOrder::Verdict::kRestart:
      for (const Element& element : elements_) report.deleted.push_back(element.id);
      ++report.reasons["time jumped back: new map"];
      if (!elements_.empty()) report.reasons["deleted with the map before"] += elements_.size();
      forget();
      return true;
  }
  return false;
}

void ObjectMap::forget() {
  elements_.clear();
  noise_ = 1.0;
  step_s_ = 0.0;
  resumed_ = false;
}

void ObjectMap::reset() {
  forget();
  order_ = StampOrder(params_.reset_time_jump_s);
}

MapSnapshot ObjectMap::snapshot() const {
  MapSnapshot result;
  result.shape = params_.shape;
  result.stamp_ns = stamp_ns();
  result.step_s = step_s_;
  result.T_world_level = T_world_level_;
  result.height_world_m = height_world_m_;
  result.noise = noise_;
  result.next_id = next_id_;
  result.elements.assign(elements_.begin(), elements_.end());
  // A body that is gone is as good as none: ids are never used again.
  for (MapElement& element : result.elements) {
    if (find(element.body) == nullptr) element.body = 0;
  }
  return result;
}

void ObjectMap::restore(const MapSnapshot& snapshot) {
  snapshot.validate();
  if (snapshot.shape != params_.shape) {
    throw std::invalid_argument("shape = " + snapshot.shape + " is not this map's, " + params_.shape);
  }
  std::vector<Element> elements;
  elements.reserve(snapshot.elements.size());
  for (const MapElement& element : snapshot.elements) elements.push_back({element});
  reset();
  order_.judge(snapshot.stamp_ns);
  elements_ = std::move(elements);
  T_world_level_ = snapshot.T_world_level;
  noise_ = snapshot.noise;
  step_s_ = snapshot.step_s;
  height_world_m_ = snapshot.height_world_m;
  next_id_ = std::max(next_id_, snapshot.next_id);
}

void ObjectMap::resume(const MapSnapshot& snapshot) {
  const std::int64_t latest_ns = stamp_ns();
  restore(snapshot);
  if (latest_ns != kNoStamp) move_stamps_to(latest_ns);
  resumed_ = true;
}

/// Take the map for one of another time.
void ObjectMap::move_stamps_to(std::int64_t stamp_ns) {
  const std::int64_t later_ns = stamp_ns - order_.latest_ns();
  for (Element& element : elements_) {
    element.first_seen_ns += later_ns;
    element.last_seen_ns += later_ns;
  }
  order_ = StampOrder(params_.reset_time_jump_s);
  order_.judge(stamp_ns);
}

/// Finds out which of the measurements are of which elements: into `work_.associations`.
void ObjectMap::associate(const Pose2& T_world_level, const Eigen::Matrix3d& U) {
  // Measurements sorted by x, so that each element looks only at those that its gate can reach.
  const std::vector<Measurement>& measurements = work_.measurements;
  std::vector<Place>& by_x = work_.by_x;
  by_x.clear();
  // On an element that has just been seen: that one's, not one's that was out of sight.
  std::vector<char>& on_seen = work_.on_seen;
  on_seen.clear();
  work_.seen_lately = seen_within(kRecently_s, std::move(work_.seen_lately));
  double widest_variance = 0.0;
  double longest_offset_s = 0.0;
  for (const Measurement& measurement : measurements) {
    by_x.push_back({T_world_level * Eigen::Vector2d(measurement.z.head<2>()), static_cast<int>(by_x.size())});
    on_seen.push_back(work_.seen_lately.cover(by_x.back().center_world_m) ? 1 : 0);
    widest_variance = std::max(widest_variance, measurement.R.topLeftCorner<2, 2>().trace());
    longest_offset_s = std::max(longest_offset_s, std::abs(measurement.time_offset_s));
  }
  std::sort(by_x.begin(), by_x.end(), [](const Place& a, const Place& b) {
    return std::make_pair(a.center_world_m.x(), a.measurement) < std::make_pair(b.center_world_m.x(), b.measurement);
  });

  std::vector<Candidate>& candidates = work_.candidates;
  std::vector<MotionMatch>& matches = work_.matches;
  candidates.clear();
  matches.clear();
  work_.associations.clear();
  std::vector<Rejection>& rejections = work_.rejections;
  rejections.assign(measurements.size(), {});
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    const MotionEstimate& estimate = elements_[i].estimate;
    const bool was_lost = unseen_s(elements_[i]) > kRecently_s;
    const Eigen::Vector2d center_m = position(estimate.moving);
    const double lever_m = (center_m - T_world_level.translation_m).norm();
    const double variance = std::max(position_variance(estimate.standing), position_variance(estimate.moving)) +
                            U.topLeftCorner<2, 2>().trace() + lever_m * lever_m * U(2, 2) + widest_variance;
    const bool lost = uncertain_by_m(elements_[i]) > kLost * params_.max_position_sigma_m;
    const double detected = log_detection_ratio(i);
    const double fastest_m_s = estimate.moving.x.segment<2>(kVelocity).norm() +
                               std::sqrt(gate_ * estimate.moving.P.block<2, 2>(kVelocity, kVelocity).trace());
    const double reach_m =
        std::sqrt(gate_ * variance) + longest_offset_s * fastest_m_s + (center_m - position(estimate.standing)).norm();
    auto near = std::lower_bound(by_x.begin(), by_x.end(), center_m.x() - reach_m,
                                 [](const Place& place, double x_m) { return place.center_world_m.x() < x_m; });
    for (; near != by_x.end() && near->center_world_m.x() <= center_m.x() + reach_m; ++near) {
      if (std::abs(near->center_world_m.y() - center_m.y()) > reach_m) continue;
      const auto j = static_cast<std::size_t>(near->measurement);
      const Measurement& measurement = measurements[j];
      Rejection& rejection = rejections[j];
      // Nothing sure is said by a piece about what may be anywhere.
      if ((was_lost && on_seen[j] != 0) || (lost && measurement.hidden_end)) {
        if (*rejection.reason == '\0') rejection.reason = kOutOfSight;
        continue;
      }
      const MotionMatch candidate = match(estimate, T_world_level, measurement, U);
      const double log_ratio = candidate.log_likelihood - kLogNewObjectDensity + detected;
      const char* defect = mismatch(elements_[i], candidate);
      if (*defect == '\0' && !(log_ratio > 0.0)) defect = "match rejected: more probably something new";
      if (candidate.log_likelihood > rejection.log_likelihood) {
        rejection = {*defect != '\0' ? defect : "match rejected: taken by another", candidate.log_likelihood};
      }
      if (*defect != '\0') continue;
      candidates.push_back({static_cast<int>(i), near->measurement, -log_ratio});
      matches.push_back(candidate);
    }
  }
  if (candidates.empty()) return;

  std::vector<int>& measurement_of_element = work_.measurement_of_element;
  measurement_of_element = assign(static_cast<int>(elements_.size()), static_cast<int>(measurements.size()), candidates,
                                  std::move(measurement_of_element));

  for (std::size_t c = 0; c < candidates.size(); ++c) {
    const auto element = static_cast<std::size_t>(candidates[c].row);
    if (measurement_of_element[element] != candidates[c].column) continue;
    work_.associations.push_back({element, static_cast<std::size_t>(candidates[c].column), matches[c]});
  }
}

/// Why a match cannot be of an element; empty text if it may be. What stood when it was last seen, a while ago, is
/// looked for where it stood: as something that has set off since, it could be anywhere.
const char* ObjectMap::mismatch(const Element& element, const MotionMatch& match) const {
  const bool stood = !element.mobile && element.estimate.p_moving < 0.5 && unseen_s(element) > kRecently_s;
  const bool inside = match.standing.mahalanobis2 <= gate_ || (!stood && match.moving.mahalanobis2 <= gate_);
  if (!inside) return "match rejected: outside the gate";
  const bool anywhere = element.common_shape && position_sigma_m(likelier(element.estimate)) > kCommonReach_m;
  return anywhere ? kOutOfSight : "";
}

/// The element that a whole detection lies on although it does not match: two objects are not in one place, so the
/// element was wrong (its first views were pieces of it, say). Elements that were lost sight of do not count.
ObjectMap::Element* ObjectMap::in_the_place_of(const Measurement& measurement, const Pose2& T_world_level) {
  if (measurement.hidden_end) return nullptr;
  const Eigen::Vector2d center_world_m = T_world_level * Eigen::Vector2d(measurement.z.head<2>());
  Element* nearest = nullptr;
  double nearest_m = 0.0;
  for (Element& element : elements_) {
    if (unseen_s(element) <= 0.0 || unseen_s(element) > kRecently_s) continue;
    const Ellipse ellipse = ellipse_world(likelier(element.estimate).x);
    if (!contains(ellipse, center_world_m)) continue;
    const double distance_m = (ellipse.center_m - center_world_m).norm();
    if (nearest != nullptr && distance_m >= nearest_m) continue;
    nearest = &element;
    nearest_m = distance_m;
  }
  return nearest;
}

ObjectMap::Element ObjectMap::new_element(const Measurement& measurement, const Pose2& T_world_level,
                                          const Eigen::Matrix3d& U) {
  Element element;
  element.id = next_id_++;
  element.estimate = new_estimate(measurement, T_world_level, U);
  element.first_seen_ns = stamp_ns();
  return element;
}

MotionEstimate ObjectMap::new_estimate(const Measurement& measurement, const Pose2& T_world_level,
                                       const Eigen::Matrix3d& U) const {
  ObjectEstimate mapped = map_measurement(measurement, T_world_level, U);
  if (params_.shape == "circle") make_circle(mapped);
  bound_radii(mapped.x, kMinRadius_m);
  return start(mapped, motion_);
}

void ObjectMap::observe(Element& element, const Detection& detection, const Measurement& measurement,
                        const Pose2& T_world_level) const {
  // A better view counts at once, a worse one as it lasts.
  const Matrix8d P_view = state_covariance(measurement.R, T_world_level);
  const bool better = element.observations == 0 || P_view.trace() < element.P_view.trace();
  element.P_view += (better ? 1.0 : kViewForgetting) * (P_view - element.P_view);
  element.last_seen_ns = stamp_ns();
  element.beams = detection.beams;
  ++element.observations;
  const double weight = detection.hidden_end ? params_.hidden_observation_weight : 1.0;
  element.log_odds = std::min(element.log_odds + weight * kLogOddsOfDetection, kMaxLogOdds);
  if (element.estimate.p_moving < 0.5) element.stood_s += step_s_;
  const bool moved = element.moves;
  element.moves = element.estimate.p_moving > kSurelyMoves;
  if (element.moves && !moved) element.set_off_world_m = position(element.estimate.moving);
  const double way_m = (position(element.estimate.moving) - element.set_off_world_m).norm();
  element.mobile |= element.moves && way_m > kTravel_m;
  element.just_confirmed = !element.confirmed && element.log_odds >= log_odds(params_.confirmation_probability);
  element.confirmed |= element.just_confirmed;
}

EllipsesByX ObjectMap::seen_within(double past_s, EllipsesByX memory) const {
  std::vector<Ellipse> ellipses = memory.release();
  ellipses.clear();
  for (const Element& element : elements_) {
    if (unseen_s(element) > past_s) continue;
    ellipses.push_back(ellipse_world(combine(element.estimate).x));
  }
  return EllipsesByX(std::move(ellipses));
}

/// Look where the elements should be, and say how probably the scan has a detection of each, if it exists: with
/// `detection_probability` where beams reach it, the less the less certain its place is, and not where something hides
/// it.
void ObjectMap::expect_detections(const Detections& detections) {
  const Pose2 T_level_world = inverse(detections.T_world_level);
  work_.expected.clear();
  for (const Element& element : elements_) {
    const ObjectEstimate& estimate = likelier(element.estimate);
    ExpectedDetection expected;
    expected.ellipse_world = ellipse_world(estimate.x);
    expected.sight = look_at(T_level_world * expected.ellipse_world, detections.free_space, kSightMargin_m);
    if (expected.sight != Sight::kHidden) {
      const double sigma_m = position_sigma_m(estimate);
      const double radius2 = expected.ellipse_world.rx_m * expected.ellipse_world.ry_m;
      expected.probability = params_.detection_probability * radius2 / (radius2 + sigma_m * sigma_m);
    }
    work_.expected.push_back(expected);
  }
}

/// The logarithm of P_D / (1 - p_D): how much more probable it is that an element is detected than that it is missed.
/// P_D is that of a place where a detection is, so nothing hides it; p_D that of the place where the element is
/// expected.
double ObjectMap::log_detection_ratio(std::size_t element) const {
  return std::log(params_.detection_probability) - std::log1p(-work_.expected[element].probability);
}

/// The elements that were not detected exist less probably, but only where beams say that they are not there: what is
/// hidden keeps its existence.
void ObjectMap::missed_detection_update() {
  work_.seen_now = seen_within(0.0, std::move(work_.seen_now));
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    Element& element = elements_[i];
    const ExpectedDetection& expected = work_.expected[i];
    if (element.last_seen_ns == stamp_ns() || expected.sight == Sight::kHidden) continue;
    const bool hit = expected.sight == Sight::kHit && !work_.seen_now.cover(expected.ellipse_world.center_m);
    element.log_odds += std::log1p(-expected.probability * (hit ? kMissedWhereHit : 1.0));
    // What can move is not where it should be, but may be elsewhere: it is off the map, and remembered.
    if (element.confirmed && (element.mobile || element.estimate.p_moving > 0.5)) {
      element.log_odds = std::max(element.log_odds, log_odds(params_.birth_probability));
    }
  }
}

const ObjectMap::Element* ObjectMap::find(std::uint64_t id) const {
  const auto place = std::lower_bound(elements_.begin(), elements_.end(), id,
                                      [](const Element& element, std::uint64_t wanted) { return element.id < wanted; });
  return place != elements_.end() && place->id == id ? &*place : nullptr;
}

/// A shape that several others have, too, says little of which one it is.
void ObjectMap::compare_shapes() {
  std::vector<std::pair<double, std::size_t>>& by_mean_radius = work_.by_mean_radius;
  by_mean_radius.clear();
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    if (elements_[i].confirmed) by_mean_radius.emplace_back(likelier(elements_[i].estimate).x(kShape), i);
  }
  std::sort(by_mean_radius.begin(), by_mean_radius.end());
  const auto half_difference_m = [&](std::size_t i) { return likelier(elements_[i].estimate).x.tail<2>().norm(); };
  for (std::size_t k = 0; k < by_mean_radius.size(); ++k) {
    Element& element = elements_[by_mean_radius[k].second];
    int others = 0;
    const auto alike = [&](std::size_t other) {
      return std::abs(half_difference_m(by_mean_radius[other].second) - half_difference_m(by_mean_radius[k].second)) <=
             kAlike_m;
    };
    for (std::size_t j = k;
         others < kCommon && j-- > 0 && by_mean_radius[k].first - by_mean_radius[j].first <= kAlike_m;) {
      others += alike(j) ? 1 : 0;
    }
    for (std::size_t j = k + 1;
         others < kCommon && j < by_mean_radius.size() && by_mean_radius[j].first - by_mean_radius[k].first <= kAlike_m;
         ++j) {
      others += alike(j) ? 1 : 0;
    }
    element.common_shape = others >= kCommon;
  }
}

/// What is new may be one that was out of sight: its shape says so, if it could have come here. It then gets its
/// identity back.
void ObjectMap::recognise_lost() {
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    if (!elements_[i].just_confirmed) continue;
    const ObjectEstimate found = combine(elements_[i].estimate);
    Measurement as_measurement;
    const Matrix58d H = measurement_jacobian({}, 0.0);
    as_measurement.z = measure(found.x, {}, 0.0);
    as_measurement.R = H * found.P * H.transpose();
    std::size_t best = i;
    double most = kLogNewObjectDensity;
    for (std::size_t j = 0; j < i; ++j) {  // ids grow: the lost are before
      const Element& lost = elements_[j];
      if (!lost.confirmed || lost.is_part || unseen_s(lost) < kRecently_s) continue;
      const MotionMatch candidate = match(lost.estimate, {}, as_measurement, Eigen::Matrix3d::Zero());
      if (*mismatch(lost, candidate) != '\0' || !(candidate.log_likelihood > most)) continue;
      most = candidate.log_likelihood;
      best = j;
    }
    if (best == i) continue;
    Element& lost = elements_[best];
    Element& element = elements_[i];
    lost.estimate = element.estimate;
    lost.log_odds = element.log_odds;
    lost.last_seen_ns = element.last_seen_ns;
    lost.beams = element.beams;
    lost.observations += element.observations;
    element.log_odds = -kMaxLogOdds;  // the other is it
    element.known_again = true;
    element.confirmed = false;
    element.last_seen_ns = element.first_seen_ns;
  }
}

/// Elements that stay side by side while they travel are one body: the small one becomes part of the other, goes on
/// being followed, and comes back as itself when they part. An arm swings, so velocities say little: the way travelled
/// since they met does.
void ObjectMap::join_parts() {
  std::vector<Body>& bodies = work_.bodies;
  bodies.clear();
  double largest_m = 0.0;
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    const Element& element = elements_[i];
    if (element.is_part || element.estimate.p_moving < 0.5 || unseen_s(element) > kRecently_s) continue;
    bodies.push_back({ellipse_world(element.estimate.moving.x), i});
    largest_m = std::max(largest_m, bodies.back().ellipse_world.rx_m);
  }
  std::sort(bodies.begin(), bodies.end(), [](const Body& a, const Body& b) {
    return std::make_pair(a.ellipse_world.center_m.x(), a.element) <
           std::make_pair(b.ellipse_world.center_m.x(), b.element);
  });

  for (std::size_t i = 0; i < elements_.size(); ++i) {
    Element& part = elements_[i];
    if (part.last_seen_ns != stamp_ns()) continue;
    const Ellipse ellipse = ellipse_world(likelier(part.estimate).x);
    if (part.is_part) {
      const Element* const body = find(part.body);
      if (body != nullptr && gap_m(ellipse_world(combine(body->estimate).x), ellipse) <= 2.0 * params_.max_part_gap_m) {
        continue;
      }
      part.is_part = false;
      part.body = 0;
    }
    const double mean_radius_m = 0.5 * (ellipse.rx_m + ellipse.ry_m);
    if (mean_radius_m > params_.max_part_radius_m) continue;

    // The nearest body that is larger, or as large and older.
    const double reach_m = largest_m + ellipse.rx_m + params_.max_part_gap_m;
    auto near = std::lower_bound(bodies.begin(), bodies.end(), ellipse.center_m.x() - reach_m,
                                 [](const Body& body, double x_m) { return body.ellipse_world.center_m.x() < x_m; });
    const Body* nearest = nullptr;
    double nearest_m = params_.max_part_gap_m;
    for (; near != bodies.end() && near->ellipse_world.center_m.x() <= ellipse.center_m.x() + reach_m; ++near) {
      const Element& body = elements_[near->element];
      if (body.id == part.id || body.is_part) continue;
      const double body_radius_m = 0.5 * (near->ellipse_world.rx_m + near->ellipse_world.ry_m);
      const bool larger = body_radius_m > 1.5 * mean_radius_m;
      const bool as_large = body_radius_m > mean_radius_m / 1.5;
      if (!larger && !(as_large && body.id < part.id)) continue;
      const double gap = gap_m(near->ellipse_world, ellipse);
      if (gap > nearest_m) continue;
      nearest_m = gap;
      nearest = &*near;
    }
    if (nearest == nullptr) {
      part.body = 0;
      continue;
    }
    Element& body = elements_[nearest->element];
    if (part.body != body.id) {
      part.body = body.id;
      part.met_world_m = ellipse.center_m;
      part.body_met_world_m = nearest->ellipse_world.center_m;
    }
    const Eigen::Vector2d body_way_m = nearest->ellipse_world.center_m - part.body_met_world_m;
    const Eigen::Vector2d way_m = ellipse.center_m - part.met_world_m;
    const bool together =
        body_way_m.norm() >= params_.min_part_travel_m && way_m.dot(body_way_m) >= 0.5 * body_way_m.squaredNorm();
    // A body that has limbs may show another; what was standing there before is none.
    const bool limb = body.has_parts && (part.observations == 1 || part.mobile);
    if (!together && !limb) continue;
    part.is_part = true;
    body.has_parts = true;
    for (Element& other : elements_) {
      if (other.is_part && other.body == part.id) other.body = body.id;
    }
  }
}

/// Map management (circle paper, Sect. V-B3).
void ObjectMap::delete_outdated(ObjectMapUpdate& report) {
  const auto outdated = [&](const Element& element) -> const char* {
    if (element.last_seen_ns == stamp_ns()) return "";
    if (element.log_odds < log_odds(params_.deletion_probability)) {
      return element.known_again ? "known again as another" : "seen through";
    }
    if (!element.confirmed && unseen_s(element) > kMaxUnconfirmed_s) return "not confirmed";
    if (unseen_s(element) > params_.max_unseen_s) return "unseen for too long";
    if (position_sigma_m(likelier(element.estimate)) > params_.lost_position_sigma_m) return "position too uncertain";
    return "";
  };
  std::vector<char>& drop = work_.drop;
  drop.clear();
  for (const Element& element : elements_) {
    const char* reason = outdated(element);
    drop.push_back(*reason != '\0' ? 1 : 0);
    if (drop.back() != 0) ++report.reasons[reason];
  }
  // The identity of a body goes on in its largest part: at the latest when the body is off the map, which would take
  // the parts that are seen along.
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    const bool off_the_map = elements_[i].confirmed && elements_[i].log_odds <= 0.0;
    if (!(drop[i] != 0 || off_the_map) || !elements_[i].has_parts || elements_[i].is_part) continue;
    std::size_t heir = elements_.size();
    double heir_m = 0.0;
    for (std::size_t j = 0; j < elements_.size(); ++j) {
      if (drop[j] != 0 || !elements_[j].is_part || elements_[j].body != elements_[i].id) continue;
      if (drop[i] == 0 && elements_[j].last_seen_ns != stamp_ns()) continue;
      const double mean_radius_m = likelier(elements_[j].estimate).x(kShape);
      if (mean_radius_m <= heir_m) continue;
      heir = j;
      heir_m = mean_radius_m;
    }
    if (heir == elements_.size()) continue;
    if (drop[i] == 0) ++report.reasons["seen through"];
    std::swap(elements_[i].id, elements_[heir].id);
    std::swap(elements_[i].first_seen_ns, elements_[heir].first_seen_ns);
    elements_[heir].is_part = false;
    elements_[heir].body = 0;
    elements_[heir].has_parts = true;
    std::swap(elements_[i], elements_[heir]);
    drop[i] = 0;
    drop[heir] = 1;
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    if (drop[i] != 0) {
      report.deleted.push_back(elements_[i].id);
    } else {
      elements_[kept++] = elements_[i];
    }
  }
  elements_.resize(kept);
}

/// How uncertain it is where an element is: under both motions, unless one is all but certain.
double ObjectMap::uncertain_by_m(const Element& element) const {
  const double p = element.estimate.p_moving;
  const bool undecided = p > kUndecided && p < 1.0 - kUndecided;
  ObjectEstimate estimate = undecided ? combine(element.estimate) : likelier(element.estimate);
  estimate.P += params_.correlated_error_fraction * element.P_view;
  return position_sigma_m(estimate);
}

bool ObjectMap::shown(const Element& element) const {
  return element.confirmed && element.log_odds > 0.0 && !element.is_part &&
         uncertain_by_m(element) <= params_.max_position_sigma_m;
}

Objects ObjectMap::at(std::int64_t stamp_ns, Objects memory) const {
  Objects result = std::move(memory);
  result.objects.clear();
  result.stamp_ns = stamp_ns;
  result.height_world_m = height_world_m_;
  if (elements_.empty()) return result;
  const double dt_s = std::max(0.0, seconds_between(order_.latest_ns(), stamp_ns));
  for (const Element& element : elements_) {
    if (!shown(element)) continue;
    MotionEstimate estimate = element.estimate;
    if (dt_s > 0.0) predict(estimate, dt_s, motion_of(element));
    Object object;
    object.id = element.id;
    Matrix8d P_repeated = params_.correlated_error_fraction * element.P_view;
    if (params_.shape == "circle") {
      P_repeated.bottomRows<2>().setZero();
      P_repeated.rightCols<2>().setZero();
    }
    fill_object(combine(estimate), P_repeated, object);
    object.p_moving = estimate.p_moving;
    object.p_exists = 1.0 / (1.0 + std::exp(-element.log_odds));
    object.first_seen_ns = element.first_seen_ns;
    object.last_seen_ns = element.last_seen_ns;
    object.observations = element.observations;
    object.beams = element.beams;
    result.objects.push_back(object);
  }
  return result;
}

}  // namespace situation_awareness
