// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/object_map.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "situation_awareness/common/count.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/objects/shape_belief.hpp"

namespace situation_awareness {

using namespace object_state;

namespace {

// Where no source is named, none is recorded; the sensitivity of these was not measured.

/// 1/s. Transition rate from standing to moving of an object that has not been observed to move.
constexpr double kObjectStartRate_1_s = 0.005;
/// 1/s. Transition rate from standing to moving of an object that has moved, or has not been observed to stand for long
/// yet.
constexpr double kRestartRate_1_s = 0.5;
/// 1/s. Transition rate from moving to standing.
constexpr double kObjectStopRate_1_s = 0.1;
/// m/s. Prior standard deviation, per axis, of the velocity of a new object and of one that starts to move (ellipse
/// paper, eq. 17).
constexpr double kStartVelocitySigma_m_s = 1.0;
/// rad/s. Prior standard deviation of the angular velocity of a new object and of one that starts to move (ellipse
/// paper, eq. 19).
constexpr double kStartAngularVelocitySigma_rad_s = 0.3;
/// Factor on the standard deviations of a detection with an occluded end.
constexpr double kHiddenEndFactor = 3.0;

// Each constant with its unit, its source and its sensitivity. Where no source is named, none is recorded. Unless
// figures are named, half and twice the value change none beyond chance in flights (scripts/evaluate constants).

/// s. Correlation time tau of accelerations: for an exponentially correlated one with the standard deviation s, the
/// equivalent white noise has the spectral density s sqrt(2 tau) (Singer, 1970). A factor of 4 in it is one of 2 in
/// both acceleration parameters. In flights half of it raises the velocity RMSE of moving objects from 0.131 to
/// 0.153 m/s; twice lowers it to 0.113 m/s, but raises GOSPA in crowds from 0.075 to 0.095 m.
constexpr double kManoeuvre_s = 0.5;
/// Per scan. Rate at which P_view follows a worse view: 50 scans, 2.5 s at 20 Hz. No test bounds it.
constexpr double kViewForgetting = 0.02;
/// Per detection. Adaptation rate of the noise factor: within 33 detections. AdaptsToTheErrorsOfDetections
/// asserts that a matched noise is estimated at less than 1.1 times its standard deviation; the bound of this is not
/// known.
constexpr double kNoiseGain = 0.03;
/// Factor on variances, so 3.2 on standard deviations. The tests with twice the noise need 4.
constexpr double kMaxNoise = 10.0;
/// s. Decay time of the rate at which an element that stands begins to move again. No test bounds it.
constexpr double kRestartDecay_s = 0.7;
/// Probability of moving from which on an element counts as moving. No test bounds it.
constexpr double kSurelyMoving = 0.95;
/// m. An object that has moved this far without a stop is mobile. Below 1.2 m, the way of
/// AMobileElementThatIsSeenThroughIsKeptAndAStandingOneIsNot.
constexpr double kMobileAfter_m = 0.25;
/// m. As kMobileAfter_m, of a box, and at least 3 standard deviations of its position.
constexpr double kBoxMobileAfter_m = 0.3;
/// Detections in a row with which a box must surely move before it is mobile.
constexpr int kBoxMobileScans = 4;
/// Factor on the angular acceleration of a mobile box: a vehicle is at its rate of turn within a second.
constexpr double kBoxTurns = 5.0;

/// True for a confirmed element that stands and is no person.
bool is_standing(const MapElement& element) {
  return !is_person(element) && !element.mobile && element.state == TrackState::kConfirmed &&
         element.estimate.p_moving <= 0.5;
}

/// Of a dropped piece and the larger object on which it lies the id of the first seen stays.
void pass_id_on(std::size_t piece, std::vector<MapElement>& elements, std::vector<char>& dropped) {
  if (elements[piece].state == TrackState::kTentative) return;
  const Ellipse piece_world = ellipse_world(elements[piece].estimate.standing.x);
  for (std::size_t i = piece + 1; i < elements.size(); ++i) {
    if (dropped[i] != 0 || !is_standing(elements[i])) continue;
    const Ellipse larger_world = ellipse_world(elements[i].estimate.standing.x);
    if (larger_world.rx_m * larger_world.ry_m <= piece_world.rx_m * piece_world.ry_m) continue;
    if (!contains(larger_world, piece_world.center_m)) continue;
    take_over_id(piece, i, elements, dropped);
    return;
  }
}

}  // namespace

ObjectMap::ObjectMap(const ObjectMapParams& params) : params_(params) {
  set_params(params);
  work_.standing = standing({});  // has its room before any scan needs it
}

void ObjectMap::set_params(const ObjectMapParams& params) {
  params.validate();
  if (params.shape != params_.shape) {
    throw std::invalid_argument("objects.shape = " + params.shape + ", but this map is one of the shape " +
                                params_.shape);
  }
  wake_all();  // with the parameters of the time until now
  params_ = params;
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
  motion_.start_rate_1_s = kObjectStartRate_1_s;
  motion_.stop_rate_1_s = kObjectStopRate_1_s;
  motion_.start_velocity_sigma = kStartVelocitySigma_m_s;
  motion_.start_angular_velocity_sigma = circle ? 0.0 : kStartAngularVelocitySigma_rad_s;
}

/// U: the covariance of the level frame's pose. An error of the stamps shifts it along its own motion.
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

/// Elements that have moved, or have not stood for long, start at a higher rate. Out of sight, standing elements are
/// expected where they stood and moving ones along their predicted path, without transitions.
MotionParams ObjectMap::motion_of(const MapElement& element) const {
  if (is_person(element)) return motion_of_person(motion_);
  MotionParams motion = motion_;
  if (is_out_of_sight(element, stamp_ns())) motion.start_rate_1_s = motion.stop_rate_1_s = 0.0;
  if (is_box(element) && element.mobile) {  // a vehicle: its velocity turns with it
    motion.course = Course::kTurning;
    motion.moving.angular_acceleration *= kBoxTurns;
  }
  const double unsettled = is_settled(element) ? 0.0
                           : element.mobile    ? 1.0
                                               : std::exp(-element.stood_s / kRestartDecay_s);
  motion.start_rate_1_s += unsettled * (kRestartRate_1_s - motion.start_rate_1_s);
  return motion;
}

/// The covariance R of a detection in the map.
Measurement ObjectMap::widened(const Detection& detection) const {
  Measurement measurement = measurement_of(detection);
  measurement.R *= noise_;
  if (detection.hidden_end) measurement.R *= kHiddenEndFactor * kHiddenEndFactor;
  measurement.R.diagonal().array() += params_.measurement_sigma_m * params_.measurement_sigma_m;
  return measurement;
}

/// Adapts the detections' covariances by the innovations (Mehra, 1970). They are never reduced, since overconfidence
/// does more harm.
void ObjectMap::adapt_noise(double mahalanobis2) {
  noise_ = std::clamp(noise_ * (1.0 + kNoiseGain * (mahalanobis2 / kMeasurementSize - 1.0)), 1.0, kMaxNoise);
}

ObjectMapUpdate ObjectMap::update(const Detections& detections, ObjectMapUpdate memory) {
  ObjectMapUpdate report = std::move(memory);
  for (std::vector<std::uint64_t>* const ids : {&report.updated, &report.created, &report.deleted}) {
    ids->clear();
    ids->reserve(kUsualRoom);
  }
  report.reasons.reset();
  report.matches = 0;
  report.mahalanobis2 = 0.0;
  report.log_likelihood = 0.0;
  const std::int64_t previous_ns = stamp_ns();
  const Advance advance = advance_to(detections.stamp_ns, report);
  if (advance == Advance::kRefused) return report;
  height_world_m_ = detections.height_world_m;
  const Eigen::Matrix3d U = robot_covariance(detections);

  std::vector<Measurement>& measurements = work_.measurements;
  measurements.clear();
  for (const Detection& detection : detections.detections) measurements.push_back(widened(detection));
  if (advance == Advance::kOneStep) {
    settle(detections, U, previous_ns);
    predict_elements();
  }
  for (MapElement& element : elements_) element.beams = 0;

  work_.recently_seen = seen_within(kLostAfter_s, std::move(work_.recently_seen));
  const std::vector<char>& common_shape =
      work_.common_shapes.find(elements_, resting_.shapes(), kMaxSigmaOfCommonShape_m);
  const Pose2 T_level_world = inverse(detections.T_world_level);
  work_.expected.clear();
  for (const MapElement& element : elements_) {
    work_.expected.push_back(
        expect_detection(element, T_level_world, detections.free_space, params_.detection_probability));
  }
  work_.people.see(detections, measurements);
  work_.people.find_candidates(elements_, work_.expected, detections.T_world_level, U, params_, gate_);
  work_.associator.associate(
      {elements_, work_.expected, common_shape, work_.recently_seen, measurements, detections.T_world_level, U,
       stamp_ns(), work_.people.candidates(), work_.people.rows(), work_.people.columns()},
      params_, gate_);
  work_.newly_confirmed.clear();
  work_.newly_confirmed.reserve(kUsualRoom);
  update_matched(detections, U, report);
  update_persons(detections, U, report);
  update_missed();
  map_unmatched(detections, U, report);
  std::sort(work_.newly_confirmed.begin(), work_.newly_confirmed.end());
  re_identify(work_.newly_confirmed, common_shape, gate_, stamp_ns(), elements_);
  work_.people.join_legs(stamp_ns(), step_s_, motion_, gate_, elements_);
  work_.body_joiner.join_parts(stamp_ns(), elements_);
  delete_elements(report);
  return report;
}

void ObjectMap::update_matched(const Detections& detections, const Eigen::Matrix3d& U, ObjectMapUpdate& report) {
  assign_with_room(work_.used, work_.measurements.size(), 0);
  work_.of_known = 0;
  const MeasuringFrame level(detections.T_world_level);
  for (const Association& association : work_.associator.associations()) {
    MapElement& element = elements_[association.element];
    const Measurement& measurement = work_.measurements[association.measurement];
    const Detection& detection = detections.detections[association.measurement];
    situation_awareness::update(element.estimate, level, measurement, association.match, U);
    bound_radii(element.estimate.standing.x, kMinRadius_m);
    bound_radii(element.estimate.moving.x, kMinRadius_m);
    if (element.state != TrackState::kTentative) ++work_.of_known;
    const double mahalanobis2 =
        (element.estimate.p_moving < 0.5 ? association.match.standing : association.match.moving).mahalanobis2;
    adapt_noise(mahalanobis2);
    ++report.matches;
    report.mahalanobis2 += mahalanobis2;
    observe(element, detection, measurement, detections.T_world_level);
    confirm_if_due(association.element, detection);
    work_.used[association.measurement] = 1;
    report.updated.push_back(element.id);
    report.log_likelihood += association.match.log_likelihood;
  }
}

/// A person takes up to two detections.
void ObjectMap::update_persons(const Detections& detections, const Eigen::Matrix3d& U, ObjectMapUpdate& report) {
  const Pose2& T_world_level = detections.T_world_level;
  for (const SeenLegs& seen :
       work_.people.update_legs(work_.associator.column_of_row(), T_world_level, stamp_ns(), step_s_, elements_)) {
    MapElement& person = elements_[seen.element];
    const MotionMatch match = situation_awareness::match(person.estimate, T_world_level, seen.middle, U);
    situation_awareness::update(person.estimate, T_world_level, seen.middle, match, U);
    observe(person, seen.as_detection, seen.view, T_world_level);
    detection_update(person, seen.as_detection, step_s_, params_);
    for (const int column : seen.columns) {
      if (column >= 0 && static_cast<std::size_t>(column) < work_.used.size()) {
        work_.used[static_cast<std::size_t>(column)] = 1;
        ++work_.of_known;
      }
    }
    report.updated.push_back(person.id);
  }
}

void ObjectMap::update_missed() {
  work_.seen_now = seen_within(0.0, std::move(work_.seen_now));
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    MapElement& element = elements_[i];
    if (element.last_seen_ns == stamp_ns()) continue;
    const ExpectedDetection& expected = work_.expected[i];
    const bool another_there = expected.sight == Sight::kHit && work_.seen_now.cover(expected.ellipse_world.center_m);
    missed_detection_update(element, expected, another_there, params_);
  }
}

ObjectMap::Advance ObjectMap::advance_to(std::int64_t stamp_ns, ObjectMapUpdate& report) {
  if (resumed_) {
    move_stamps_to(stamp_ns);
    resumed_ = false;
    step_s_ = 0.0;
    return Advance::kNoStep;
  }
  const std::int64_t previous_ns = order_.latest_ns();
  switch (order_.judge(stamp_ns)) {
    case StampOrder::Verdict::kNext:
      step_s_ = previous_ns != kNoStamp ? seconds_between(previous_ns, stamp_ns) : 0.0;
      return Advance::kOneStep;
    case StampOrder::Verdict::kRefused:
      ++report.reasons[order_.doubted() > 0      ? "stamp of another time"
                       : stamp_ns == previous_ns ? "stamp repeats"
                                                 : "stamp goes back"];
      return Advance::kRefused;
    case StampOrder::Verdict::kRestart:
      for_each_element([&](const MapElement& element) { report.deleted.push_back(element.id); });
      ++report.reasons["time jumped back: new map"];
      if (size() > 0) report.reasons["deleted with the map before"] += size();
      clear();
      return Advance::kNoStep;
  }
  return Advance::kRefused;
}

/// Takes up the elements at rest that this scan needs, and lays those down that may rest and that it does not need.
/// Which rest depends on the state of the map and on the scan alone, so that a restored map goes on like the saved one.
void ObjectMap::settle(const Detections& detections, const Eigen::Matrix3d& U, std::int64_t previous_ns) {
  work_.needs.make_room(work_.measurements.size(), elements_.size());
  bool knows_needs = false;
  const auto set_needs = [&] {
    if (knows_needs) return;
    work_.needs.set(detections, work_.measurements, U, gate_, params_.standing_drift_m, elements_);
    knows_needs = true;
  };
  if (!resting_.empty()) {
    set_needs();
    work_.needs.mark(resting_);
    resting_.mark_ended(detections.stamp_ns);
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    const MapElement& element = elements_[i];
    const std::int64_t end_ns = end_of_rest_ns(element, previous_ns, params_);
    if (end_ns > detections.stamp_ns) {
      set_needs();
      const RestingPlace place = resting_place(element, previous_ns);
      if (!work_.needs.needs(place)) {
        resting_.add(element, place, end_ns);
        continue;
      }
    }
    if (kept != i) elements_[kept] = element;
    ++kept;
  }
  elements_.resize(kept);
  resting_.give_marked(previous_ns, motion_at_rest(motion_), elements_);
}

void ObjectMap::predict_elements() {
  for (MapElement& element : elements_) {
    age(element, stamp_ns());
    if (is_person(element)) predict_legs(element, step_s_);
    predict(element.estimate, step_s_, motion_of(element));
  }
}

void ObjectMap::wake_all() {
  if (resting_.empty()) return;
  resting_.mark_all();
  resting_.give_marked(stamp_ns(), motion_at_rest(motion_), elements_);
}

void ObjectMap::clear() {
  elements_.clear();
  resting_.clear();
  noise_ = 1.0;
  step_s_ = 0.0;
  resumed_ = false;
}

void ObjectMap::reset() {
  clear();
  order_.reset();
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
  resting_.bring_to(stamp_ns(), motion_at_rest(motion_));
  result.elements.reserve(size());
  for_each_element([&](const MapElement& element) { result.elements.push_back(element); });
  // A deleted body is equivalent to none: ids are not reused.
  for (MapElement& element : result.elements) {
    if (find_element(element.body, result.elements) == nullptr) element.body = 0;
  }
  return result;
}

void ObjectMap::restore(const MapSnapshot& snapshot) {
  snapshot.validate();
  if (snapshot.shape != params_.shape) {
    throw std::invalid_argument("shape = " + snapshot.shape + " is not this map's, " + params_.shape);
  }
  std::vector<MapElement> elements = snapshot.elements;
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

/// Shift the map to another time.
void ObjectMap::move_stamps_to(std::int64_t stamp_ns) {
  const std::int64_t later_ns = stamp_ns - order_.latest_ns();
  for (MapElement& element : elements_) {
    element.first_seen_ns += later_ns;
    element.last_seen_ns += later_ns;
  }
  order_.reset();
  order_.judge(stamp_ns);
}

/// Whether it surely moves and is away from where it began to: an ellipse from where that was sure, a box, which has to
/// be sure of it for longer and with both ends in view, from where it stood. The visible faces of a box change, which
/// looks like motion for a moment.
bool ObjectMap::has_travelled(const MapElement& element) const {
  const double way_m = (position(element.estimate.moving) - element.set_off_world_m).norm();
  if (!is_box(element)) return element.moving_scans > 0 && way_m > kMobileAfter_m;
  return element.moving_scans >= kBoxMobileScans &&
         way_m > std::max(kBoxMobileAfter_m, 3.0 * position_sigma_m(element.estimate.moving));
}

/// Updates of an element by a detection other than its estimate and existence: view covariance and motion flags.
void ObjectMap::observe(MapElement& element, const Detection& detection, const Measurement& measurement,
                        const Pose2& T_world_level) const {
  // A better view counts at once, a worse one gradually.
  const Matrix8d P_view = state_covariance(view_covariance(detection, measurement.R), T_world_level);
  const bool better = element.observations == 0 || P_view.trace() < element.P_view.trace();
  element.P_view += (better ? 1.0 : kViewForgetting) * (P_view - element.P_view);
  shape_update(element, detection, T_world_level);
  element.last_seen_ns = stamp_ns();
  element.beams = detection.beams;
  count_more(element.observations);
  const bool stands = element.estimate.p_moving < 0.5;
  if (stands) element.stood_s += step_s_;
  // What comes out from behind an occluder grows at that end, and its middle moves; what is where it was free moves.
  const bool may_grow = is_box(element) && detection.hidden_end && !detection.has_arrived;
  if (element.estimate.p_moving <= kSurelyMoving) {
    element.moving_scans = 0;
  } else if (!may_grow) {
    count_more(element.moving_scans);
  }
  if (is_box(element)) {
    if (stands) element.set_off_world_m = position(element.estimate.standing);
  } else if (element.moving_scans == 1) {
    element.set_off_world_m = position(element.estimate.moving);
  }
  element.mobile |= has_travelled(element);
}

void ObjectMap::confirm_if_due(std::size_t element, const Detection& detection) {
  if (detection_update(elements_[element], detection, step_s_, params_)) work_.newly_confirmed.push_back(element);
}

EllipsesByX ObjectMap::seen_within(double past_s, EllipsesByX memory) const {
  std::vector<Ellipse> ellipses = memory.release();
  ellipses.clear();
  for (const MapElement& element : elements_) {
    if (unseen_s(element, stamp_ns()) > past_s) continue;
    ellipses.push_back(ellipse_world(combined_state(element.estimate)));
  }
  return EllipsesByX(std::move(ellipses));
}

/// Confirmed elements that stand.
EllipsesByX ObjectMap::standing(EllipsesByX memory) const {
  std::vector<Ellipse> ellipses = memory.release();
  ellipses.clear();
  ellipses.reserve(kUsualRoom);
  for (const MapElement& element : elements_) {
    if (is_standing(element)) ellipses.push_back(ellipse_world(element.estimate.standing.x));
  }
  return EllipsesByX(std::move(ellipses));
}

/// Map management (circle paper, Sect. V-B3).
void ObjectMap::delete_elements(ObjectMapUpdate& report) {
  std::vector<char>& dropped = work_.dropped;
  dropped.clear();
  std::vector<std::size_t>& pieces = work_.pieces;
  pieces.clear();
  pieces.reserve(kUsualRoom);
  const auto may_be_piece = [](const MapElement& element) { return is_box(element) && !element.mobile; };
  if (std::any_of(elements_.begin(), elements_.end(), may_be_piece)) {
    work_.standing = standing(std::move(work_.standing));
  }
  for (const MapElement& element : elements_) {
    const char* reason = deletion_reason(element, stamp_ns(), params_);
    // A piece of a surface that lost returns slides along it from scan to scan, onto what is known of it.
    if (may_be_piece(element) && work_.standing.cover_by_larger(ellipse_world(element.estimate.standing.x))) {
      reason = "piece of a larger object";
      pieces.push_back(dropped.size());
    }
    dropped.push_back(*reason != '\0' ? 1 : 0);
    if (dropped.back() != 0) ++report.reasons[reason];
  }
  for (const std::size_t piece : pieces) pass_id_on(piece, elements_, dropped);
  const std::size_t off_the_map = transfer_body_ids(stamp_ns(), elements_, dropped);
  if (off_the_map > 0) report.reasons["seen through"] += off_the_map;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < elements_.size(); ++i) {
    if (dropped[i] != 0) {
      report.deleted.push_back(elements_[i].id);
    } else {
      if (kept != i) elements_[kept] = elements_[i];
      ++kept;
    }
  }
  elements_.resize(kept);
}

Objects ObjectMap::at(std::int64_t stamp_ns, Objects memory) const {
  Objects result = std::move(memory);
  result.objects.clear();
  result.stamp_ns = stamp_ns;
  result.height_world_m = height_world_m_;
  if (size() == 0) return result;
  resting_.bring_to(order_.latest_ns(), motion_at_rest(motion_));
  const double dt_s = std::max(0.0, seconds_between(order_.latest_ns(), stamp_ns));
  for_each_element([&](const MapElement& element) {
    if (!is_on_map(element, params_)) return;
    MotionEstimate estimate = element.estimate;
    if (dt_s > 0.0) predict(estimate, dt_s, motion_of(element));
    Object object;
    object.id = element.id;
    Matrix8d P_correlated = params_.correlated_error_fraction * element.P_view;
    if (params_.shape == "circle") {
      P_correlated.bottomRows<2>().setZero();
      P_correlated.rightCols<2>().setZero();
    }
    // The views of a box's faces change: that it moves is certain only when it has travelled.
    const bool as_standing = is_box(element) && !element.mobile;
    fill_object(as_standing ? estimate.standing : combine(estimate), P_correlated, object);
    fill_shape(element, object);
    object.object_class = element.object_class;
    object.p_class = element.p_class;
    object.p_moving = as_standing ? 0.0 : estimate.p_moving;
    object.p_exists = probability(element.log_odds);
    object.first_seen_ns = element.first_seen_ns;
    object.last_seen_ns = element.last_seen_ns;
    object.observations = element.observations;
    object.beams = element.beams;
    result.objects.push_back(object);
  });
  return result;
}

}  // namespace situation_awareness
