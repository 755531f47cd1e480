// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/existence.hpp"

#include <algorithm>
#include <cmath>

namespace situation_awareness {

namespace {

// Each constant with its unit, its source and its sensitivity. Where no source is named, none is recorded; where a test
// is named, the bounds are the values for which it passes. Unless figures are named, half and twice the value change
// none beyond chance in flights (scripts/evaluate constants).

/// Log-likelihood ratio of a detection with both ends visible: a true object is detected at its predicted place four
/// times as often as clutter. The tests of three scans to the map, and of nine with a hidden end, pass for factors from
/// 3.5 to 4.1 (object_map_test). In flights half of it, a factor of 2, lowers the recall by 0.014; twice, a
/// factor of 16, raises it by 0.006, and the velocity RMSE of standing objects from 0.2 to 1.5 mm/s.
const double kLogOddsOfDetection = std::log(4.0);
/// A detection of at least so many hits counts more: clutter has fewer.
constexpr int kManyBeams = 8;
/// m. A small ellipse near the sensor has as many: legs, arms, chair legs, which come and go.
constexpr double kSmall_m = 0.1;
/// Factor on the weight of such a detection. With 2 the second scan confirms it.
constexpr double kWeightOfManyBeams = 2.0;
/// s. Scans up to so far apart repeat each other's errors, and with a hidden end hidden_observation_weight holds. With
/// half of this and of kIndependent_s a scanner of 10 Hz maps pieces of walls (0.46 false per scan).
constexpr double kRepeats_s = 0.1;
/// s. Scans so far apart count fully, so that an object is on the map within half a second of scans at 4 Hz, too.
constexpr double kIndependent_s = 0.2;
/// Upper bound of the log-odds, p = 0.999. With p_D = 0.6 it takes 8 scans seen through to fall to even odds; at most
/// 10 are allowed, which are reached with a bound of 9.2 (AnElementThatIsSeenThroughIsDeletedSoon).
constexpr double kMaxLogOdds = 6.9;
/// Fraction of p_D, where beams end on the element but nothing was detected: something else may be in its place. Up to
/// 0.48 an element survives a second of scans that the detector refuses (object_map_test).
constexpr double kMissedWhereHit = 0.1;
/// s. Timeout of an unseen tentative element: 20 scans at 20 Hz. It may be up to 2 s by
/// ATentativeElementIsDeletedWithinTwoSeconds.
constexpr double kMaxTentativeUnseen_s = 1.0;
/// Probability. With p_moving between this and one minus this, the motion is ambiguous. From 0.05 to 0.5 by
/// AnAmbiguousMotionMakesThePositionUncertain.
constexpr double kAmbiguousMotion = 0.1;

}  // namespace

double log_odds(double p) { return std::log(p / (1.0 - p)); }

double probability(double log_odds) { return 1.0 / (1.0 + std::exp(-log_odds)); }

bool is_out_of_sight(const MapElement& element, std::int64_t stamp_ns) {
  return unseen_s(element, stamp_ns) > kLostAfter_s;
}

ExpectedDetection expect_detection(const MapElement& element, const Pose2& T_level_world, const FreeSpace& free_space,
                                   double detection_probability) {
  const ObjectEstimate& estimate = likelier(element.estimate);
  ExpectedDetection expected;
  expected.ellipse_world = ellipse_world(estimate.x);
  expected.sight = look_at(T_level_world * expected.ellipse_world, free_space, kSightMargin_m);
  if (expected.sight != Sight::kHidden) {
    const double sigma_m = position_sigma_m(estimate);
    const double radius2 = expected.ellipse_world.rx_m * expected.ellipse_world.ry_m;
    expected.probability = detection_probability * radius2 / (radius2 + sigma_m * sigma_m);
  }
  return expected;
}

void begin_existence(MapElement& element, const ObjectMapParams& params) {
  element.log_odds = log_odds(params.birth_probability);
  const bool confirmed = element.log_odds >= log_odds(params.confirmation_probability);
  element.state = confirmed ? TrackState::kConfirmed : TrackState::kTentative;
}

bool detection_update(MapElement& element, const Detection& detection, double step_s, const ObjectMapParams& params) {
  const double independent = std::clamp((step_s - kRepeats_s) / (kIndependent_s - kRepeats_s), 0.0, 1.0);
  double weight = detection.hidden_end
                      ? params.hidden_observation_weight + independent * (1.0 - params.hidden_observation_weight)
                      : 1.0;
  const bool is_small = detection.shape == Shape::kEllipse && detection.ellipse_level.rx_m < kSmall_m;
  if (detection.beams >= kManyBeams && !is_small) weight *= kWeightOfManyBeams;
  element.log_odds = std::min(element.log_odds + weight * kLogOddsOfDetection, kMaxLogOdds);
  const bool tentative = element.state == TrackState::kTentative;
  if (tentative && element.log_odds < log_odds(params.confirmation_probability)) return false;
  element.state = TrackState::kConfirmed;
  return tentative;
}

void missed_detection_update(MapElement& element, const ExpectedDetection& expected, bool another_there,
                             const ObjectMapParams& params) {
  if (expected.sight == Sight::kHidden) return;
  const bool hit = expected.sight == Sight::kHit && !another_there;
  element.log_odds += std::log1p(-expected.probability * (hit ? kMissedWhereHit : 1.0));
  const bool can_move = element.mobile || element.estimate.p_moving > 0.5;
  if (element.state != TrackState::kTentative && can_move) {
    element.log_odds = std::max(element.log_odds, log_odds(params.birth_probability));
  }
}

void age(MapElement& element, std::int64_t stamp_ns) {
  if (element.state == TrackState::kConfirmed && is_out_of_sight(element, stamp_ns)) element.state = TrackState::kLost;
}

const char* deletion_reason(const MapElement& element, std::int64_t stamp_ns, const ObjectMapParams& params) {
  if (element.state == TrackState::kDeleted) return "re-identified as another";
  if (element.last_seen_ns == stamp_ns) return "";
  if (element.log_odds < log_odds(params.deletion_probability)) return "seen through";
  if (element.state == TrackState::kTentative && unseen_s(element, stamp_ns) > kMaxTentativeUnseen_s) {
    return "not confirmed";
  }
  if (unseen_s(element, stamp_ns) > params.max_unseen_s) return "unseen for too long";
  if (position_sigma_m(likelier(element.estimate)) > params.lost_position_sigma_m) return "position too uncertain";
  return "";
}

double published_position_sigma_m(const MapElement& element, const ObjectMapParams& params) {
  const MotionEstimate& estimate = element.estimate;
  const double p = estimate.p_moving;
  const bool ambiguous = p > kAmbiguousMotion && p < 1.0 - kAmbiguousMotion;
  constexpr int kPosition = object_state::kPosition;
  Eigen::Matrix2d P = ambiguous ? combined_position_covariance(estimate)
                                : Eigen::Matrix2d(likelier(estimate).P.block<2, 2>(kPosition, kPosition));
  P += params.correlated_error_fraction * element.P_view.block<2, 2>(kPosition, kPosition);
  return largest_sigma_m(P);
}

bool is_on_map(const MapElement& element, const ObjectMapParams& params) {
  return element.state != TrackState::kTentative && element.log_odds > 0.0 && !element.is_part &&
         (element.state == TrackState::kConfirmed ||
          published_position_sigma_m(element, params) <= params.max_position_sigma_m);
}

}  // namespace situation_awareness
