// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/people.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "people_parts.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/common/usual_room.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/objects/association.hpp"
#include "situation_awareness/map/objects/re_identification.hpp"
#include "situation_awareness/map/objects/shape_belief.hpp"

namespace situation_awareness {

using namespace object_state;

namespace {

// Each constant with its unit and its source (docs/math/people.md, "Constants").

/// m. Mean radius of a leg.
constexpr double kLegRadius_m = 0.06;
/// m. Two legs side by side are at least this wide.
constexpr double kMinBothLegs_m = 0.11;
/// s. Correlation time of a leg's way from the middle, when it walks.
constexpr double kStride_s = 0.35;
/// s. Correlation time of the hips' way from the middle of both legs: a part of a step.
constexpr double kHips_s = 0.15;
/// m. Standard deviation of the hips about the middle of the hits of both legs.
constexpr double kBothInOne_m = 0.07;
/// m. Mean radius of both legs in one, from feet together to a step seen from aside, whose hits are as wide as 0.5 m.
constexpr double kBothRadius_m = 0.15;
/// m. Standard deviation of that, and of its (p, q).
constexpr double kBothRadiusSigma_m = 0.08;
/// m. Standard deviation of the centre of a leg, of its hits alone.
constexpr double kHits_m = 0.04;
/// m^2. Variance of a shape that is set to what is expected.
constexpr double kNoShape_m2 = 1e-6;
/// m. A person less certain than this is found again by its two legs only.
constexpr double kMaxSigma_m = 0.6;
/// Spectral density of the acceleration of a person, in m/s^2/sqrt(Hz).
constexpr double kAcceleration = 1.2;
/// m. Sway of a person who stands, after 1 s.
constexpr double kStandingDrift_m = 0.03;
/// Rate at which who stands sets off.
constexpr double kStartRate_1_s = 0.5;
/// Rate at which who walks stops.
constexpr double kStopRate_1_s = 0.3;

/// A leg, or both in one, `offset_m` from the middle.
ObjectEstimate leg_estimate(const ObjectEstimate& middle, const Eigen::Vector2d& offset_m, double variance_m2,
                            double radius_m, double radius_sigma_m) {
  ObjectEstimate leg = middle;
  leg.x.segment<2>(kPosition) += offset_m;
  leg.x(kAngularVelocity) = 0.0;
  leg.x.segment<3>(kShape) << radius_m, 0.0, 0.0;
  leg.P.bottomRows<4>().setZero();
  leg.P.rightCols<4>().setZero();
  leg.P.diagonal().segment<2>(kPosition).array() += variance_m2;
  leg.P.diagonal().segment<3>(kShape).array() = radius_sigma_m * radius_sigma_m;
  return leg;
}

/// Factor on the variance of an error that lasts for `correlation_s`, by which independent errors in scans every
/// `step_s` tell as little.
double repetition(double correlation_s, double step_s) {
  return step_s > 0.0 ? std::max(1.0, 2.0 * correlation_s / step_s) : 1.0;
}

}  // namespace

MotionParams motion_of_person(const MotionParams& motion) {
  MotionParams result = motion;
  result.moving.acceleration = kAcceleration;
  result.moving.angular_acceleration = 0.0;
  result.moving.radius_difference = result.standing.radius_difference = 0.0;
  result.standing.position = kStandingDrift_m;
  result.start_rate_1_s = kStartRate_1_s;
  result.stop_rate_1_s = kStopRate_1_s;
  result.start_angular_velocity_sigma = 0.0;
  return result;
}

void predict_legs(MapElement& element, double dt_s) {
  const double decay = std::exp(-dt_s / kStride_s);
  const double stride2 = kStride_m * kStride_m;
  if (element.estimate.p_moving > 0.5) element.leg_offset_world_m *= decay;  // who stands may set off at any time
  element.leg_offset_variance_m2 = stride2 + decay * decay * (element.leg_offset_variance_m2 - stride2);
}

void People::see(const Detections& detections, const std::vector<Measurement>& measurements) {
  legs_.clear();
  const auto add = [&](const Measurement& measurement, bool has_shape, bool is_ellipse, int beams, double size_m) {
    Leg leg;
    leg.measurement = measurement;
    leg.has_shape = has_shape;
    leg.is_ellipse = is_ellipse;
    leg.center_world_m = detections.T_world_level * Eigen::Vector2d(measurement.z.head<2>());
    leg.beams = beams;
    leg.may_be_one = size_m <= kMaxLeg_m;
    leg.may_be_both = size_m >= kMinBothLegs_m && size_m <= kMaxBothLegs_m;
    legs_.push_back(leg);
  };
  for (std::size_t j = 0; j < measurements.size(); ++j) {
    const Detection& detection = detections.detections[j];
    add(measurements[j], true, detection.log_box_ratio < 0.0, detection.beams, detection.ellipse_level.rx_m);
  }
  for (const SmallSegment& small : detections.small_segments) {
    // The centre of a leg is behind its hits, by about its radius times pi / 4.
    const double range_m = std::max(small.center_level_m.norm(), 1e-3);
    Measurement measurement;
    measurement.z << small.center_level_m * (1.0 + 0.25 * kPi * kLegRadius_m / range_m), kLegRadius_m, 0.0, 0.0;
    measurement.R.setZero();
    measurement.R.diagonal().head<2>().array() = kHits_m * kHits_m;
    measurement.time_offset_s = small.time_offset_s;
    add(measurement, false, true, small.beams, 0.5 * small.width_m);
  }
  by_x_.resize(legs_.size());
  for (std::size_t i = 0; i < by_x_.size(); ++i) by_x_[i] = i;
  std::sort(by_x_.begin(), by_x_.end(), [&](std::size_t a, std::size_t b) {
    return std::make_pair(legs_[a].center_world_m.x(), a) < std::make_pair(legs_[b].center_world_m.x(), b);
  });
}

void People::find_candidates(const std::vector<MapElement>& elements, const std::vector<ExpectedDetection>& expected,
                             const Pose2& T_world_level, const Eigen::Matrix3d& U, const ObjectMapParams& params,
                             double gate) {
  candidates_.clear();
  candidates_.reserve(kUsualRoom);
  parts_.clear();
  parts_.reserve(kUsualRoom);
  persons_.clear();
  persons_.reserve(kUsualRoom);
  first_row_ = elements.size();
  for (std::size_t i = 0; i < elements.size(); ++i) {
    if (is_person(elements[i])) persons_.push_back(i);
  }
  rows_ = static_cast<int>(elements.size() + 2 * persons_.size());
  for (std::size_t k = 0; k < persons_.size(); ++k) {
    const MapElement& person = elements[persons_[k]];
    const ObjectEstimate middle = combine(person.estimate);
    const double sigma_m = position_sigma_m(middle);
    if (sigma_m > kMaxSigma_m) continue;
    const double detected = log_detection_ratio(expected[persons_[k]], params.detection_probability);
    const Eigen::Vector2d& o_m = person.leg_offset_world_m;
    const double variance_m2 = person.leg_offset_variance_m2;
    const std::array<ObjectEstimate, 3> parts{
        leg_estimate(middle, o_m, variance_m2, kLegRadius_m, kLegRadiusSigma_m),
        leg_estimate(middle, -o_m, variance_m2, kLegRadius_m, kLegRadiusSigma_m),
        leg_estimate(middle, Eigen::Vector2d::Zero(), kBothInOne_m * kBothInOne_m, kBothRadius_m, kBothRadiusSigma_m)};
    const Eigen::Vector2d center_m = position(middle);
    const double reach_m = kReach_m + std::sqrt(gate) * sigma_m;
    auto near = std::lower_bound(by_x_.begin(), by_x_.end(), center_m.x() - reach_m,
                                 [&](std::size_t leg, double x_m) { return legs_[leg].center_world_m.x() < x_m; });
    for (; near != by_x_.end() && legs_[*near].center_world_m.x() <= center_m.x() + reach_m; ++near) {
      const Leg& leg = legs_[*near];
      if ((leg.center_world_m - center_m).norm() > reach_m) continue;
      const auto cost_as = [&](Part part) {
        const ObjectEstimate& expected_leg = parts[static_cast<std::size_t>(part)];
        Measurement measurement = leg.measurement;
        if (!leg.has_shape) {
          measurement.z(2) = expected_leg.x(kShape);
          measurement.R.diagonal().tail<3>().array() = kNoShape_m2;
        }
        const Match match = situation_awareness::match(expected_leg, T_world_level, measurement, U);
        return inside_gate(match, gate) ? kLogNewObjectDensity - detected - match.log_likelihood : 0.0;
      };
      const double as_first = leg.may_be_one ? cost_as(Part::kFirst) : 0.0;
      const double as_second = leg.may_be_one ? cost_as(Part::kSecond) : 0.0;
      const double as_both = leg.may_be_both ? cost_as(Part::kBoth) : 0.0;
      const auto add = [&](std::size_t row, double cost, Part part) {
        if (!(cost < 0.0)) return;
        candidates_.push_back({static_cast<int>(first_row_ + 2 * k + row), static_cast<int>(*near), cost});
        parts_.push_back(part);
      };
      add(0, std::min(as_first, as_both), as_both < as_first ? Part::kBoth : Part::kFirst);
      add(1, as_second, Part::kSecond);
    }
  }
}

/// The rows that the assignment gave each column, and the columns of each person.
void People::find_owners(const std::vector<int>& column_of_row) {
  assign_with_room(row_of_column_, legs_.size(), -1);
  assign_with_room(column_of_row_, column_of_row.size(), -1);
  std::copy(column_of_row.begin(), column_of_row.end(), column_of_row_.begin());
  columns_of_person_.reserve(kUsualRoom);  // before the first person is there
  assign_with_room(columns_of_person_, persons_.size(), {-1, -1});
  for (std::size_t row = 0; row < column_of_row.size(); ++row) {
    const int column = column_of_row[row];
    if (column < 0) continue;
    row_of_column_[static_cast<std::size_t>(column)] = static_cast<int>(row);
    if (row >= first_row_) columns_of_person_[(row - first_row_) / 2][(row - first_row_) % 2] = column;
  }
}

bool People::is_both_in_one(std::size_t person) const {
  const int row = static_cast<int>(first_row_ + 2 * person);
  for (std::size_t c = 0; c < candidates_.size(); ++c) {
    if (candidates_[c].row == row && candidates_[c].column == columns_of_person_[person][0]) {
      return parts_[c] == Part::kBoth;
    }
  }
  return false;
}

/// True if a column may be a leg of who walks: it is of no person and of no thing that has stood there.
bool People::is_free(std::size_t column, std::int64_t stamp_ns, const std::vector<MapElement>& elements) const {
  const int row = row_of_column_[column];
  if (row < 0) return true;
  if (row >= static_cast<int>(first_row_)) return false;
  const MapElement& element = elements[static_cast<std::size_t>(row)];
  const bool is_new = seconds_between(element.first_seen_ns, stamp_ns) < kSamePast_s;
  return is_foot(element, stamp_ns) && (element.mobile || is_new);
}

/// What holds both legs is a known person's rather than that of what is new: the person takes it back.
void People::find_both_in_one(std::int64_t stamp_ns, const std::vector<MapElement>& elements) {
  for (std::size_t c = 0; c < candidates_.size(); ++c) {
    if (parts_[c] != Part::kBoth) continue;
    const std::size_t person = (static_cast<std::size_t>(candidates_[c].row) - first_row_) / 2;
    const std::size_t column = static_cast<std::size_t>(candidates_[c].column);
    std::array<int, 2>& columns = columns_of_person_[person];
    const int owner = row_of_column_[column];
    if (columns[0] >= 0 || columns[1] >= 0 || owner >= static_cast<int>(first_row_)) continue;
    if (owner >= 0) {
      const MapElement& element = elements[static_cast<std::size_t>(owner)];
      const bool is_new = element.first_seen_ns > elements[persons_[person]].first_seen_ns &&
                          seconds_between(element.first_seen_ns, stamp_ns) < kSamePast_s;
      if (!is_new) continue;
      robbed_.push_back(static_cast<std::size_t>(owner));
    }
    columns[0] = candidates_[c].column;
    row_of_column_[column] = candidates_[c].row;
  }
}

/// A leg may swing faster than any gate allows: legs that persons miss are the nearest free ones within reach.
void People::find_missing_legs(std::int64_t stamp_ns, const std::vector<MapElement>& elements) {
  missing_.clear();
  missing_.reserve(kUsualRoom);
  for (std::size_t k = 0; k < persons_.size(); ++k) {
    const std::array<int, 2>& columns = columns_of_person_[k];
    const ObjectEstimate middle = combine(elements[persons_[k]].estimate);
    if ((columns[0] >= 0 && columns[1] >= 0) || position_sigma_m(middle) > kMaxSigma_m) continue;
    const int seen = std::max(columns[0], columns[1]);
    for (std::size_t leg = 0; leg < legs_.size(); ++leg) {
      if (!legs_[leg].may_be_one || !is_free(leg, stamp_ns, elements)) continue;
      const Eigen::Vector2d& center_m = legs_[leg].center_world_m;
      const double distance_m = (center_m - position(middle)).norm();
      const bool near =
          seen < 0 || !legs_[leg].has_shape
              ? distance_m <= kReach_m
              : distance_m <= kMaxApart_m &&
                    (center_m - legs_[static_cast<std::size_t>(seen)].center_world_m).norm() <= kMaxApart_m;
      if (near) missing_.push_back({distance_m, k, leg});
    }
  }
  std::sort(missing_.begin(), missing_.end(), [](const Missing& a, const Missing& b) {
    return std::make_tuple(a.distance_m, a.person, a.leg) < std::make_tuple(b.distance_m, b.person, b.leg);
  });
  for (const Missing& found : missing_) {
    std::array<int, 2>& columns = columns_of_person_[found.person];
    if (!is_free(found.leg, stamp_ns, elements) || (columns[0] >= 0 && columns[1] >= 0)) continue;
    const MapElement& person = elements[persons_[found.person]];
    const Eigen::Vector2d off_m = legs_[found.leg].center_world_m - position(combine(person.estimate));
    const std::size_t nearer = off_m.dot(person.leg_offset_world_m) >= 0.0 ? 0 : 1;
    const std::size_t side = columns[nearer] < 0 ? nearer : 1 - nearer;
    columns[side] = static_cast<int>(found.leg);
    if (row_of_column_[found.leg] >= 0) robbed_.push_back(static_cast<std::size_t>(row_of_column_[found.leg]));
    row_of_column_[found.leg] = static_cast<int>(first_row_ + 2 * found.person + side);
  }
}

const std::vector<SeenLegs>& People::update_legs(const std::vector<int>& column_of_row, const Pose2& T_world_level,
                                                 std::int64_t stamp_ns, double step_s,
                                                 std::vector<MapElement>& elements) {
  seen_.clear();
  seen_.reserve(kUsualRoom);
  find_owners(column_of_row);
  robbed_.clear();
  robbed_.reserve(kUsualRoom);
  find_both_in_one(stamp_ns, elements);
  find_missing_legs(stamp_ns, elements);
  for (std::size_t k = 0; k < persons_.size(); ++k) {
    SeenLegs seen;
    seen.element = persons_[k];
    seen.columns = columns_of_person_[k];
    if (seen.columns[0] < 0 && seen.columns[1] < 0) continue;
    const bool both = seen.columns[1] < 0 && is_both_in_one(k);
    MapElement& person = elements[seen.element];
    const Pose2 T_level_world = inverse(T_world_level);
    const Eigen::Vector2d o_level_m = T_level_world.rotation() * person.leg_offset_world_m;
    double& variance_m2 = person.leg_offset_variance_m2;
    const Eigen::Matrix2d hips = repetition(kHips_s, step_s) * kHips_m * kHips_m * Eigen::Matrix2d::Identity();
    const auto leg_of = [&](std::size_t side) -> const Leg& {
      return legs_[static_cast<std::size_t>(seen.columns[side])];
    };
    for (std::size_t side = 0; side < 2; ++side) {
      if (seen.columns[side] < 0) continue;
      seen.as_detection.beams += leg_of(side).beams;
      ++seen.legs;
    }
    if (both) {
      const Measurement& m = leg_of(0).measurement;
      seen.legs = 1;
      seen.middle = middle_at(m.z.head<2>(),
                              m.R.topLeftCorner<2, 2>() + kBothInOne_m * kBothInOne_m * Eigen::Matrix2d::Identity(),
                              m.time_offset_s);
    } else if (seen.legs == 2) {
      const Measurement& a = leg_of(0).measurement;
      const Measurement& b = leg_of(1).measurement;
      const Eigen::Matrix2d R = 0.25 * (a.R.topLeftCorner<2, 2>() + b.R.topLeftCorner<2, 2>());
      seen.middle =
          middle_at(0.5 * (a.z.head<2>() + b.z.head<2>()), R + hips, 0.5 * (a.time_offset_s + b.time_offset_s));
      person.leg_offset_world_m = T_world_level.rotation() * Eigen::Vector2d(0.5 * (a.z.head<2>() - b.z.head<2>()));
      variance_m2 = 0.5 * R.trace();
    } else {
      const std::size_t side = seen.columns[0] >= 0 ? 0 : 1;
      const double sign = side == 0 ? 1.0 : -1.0;
      const Measurement& a = leg_of(side).measurement;
      const Eigen::Matrix2d R = a.R.topLeftCorner<2, 2>();
      seen.middle = middle_at(
          a.z.head<2>() - sign * o_level_m,
          R + hips + repetition(0.5 * kStride_s, step_s) * variance_m2 * Eigen::Matrix2d::Identity(), a.time_offset_s);
      // What the leg is off the way that was predicted of it, by the share of its own variance in that.
      const ObjectEstimate middle = combine(person.estimate);
      const double others_m2 = 0.5 * (middle.P.block<2, 2>(kPosition, kPosition).trace() + R.trace());
      const double gain = variance_m2 / (variance_m2 + others_m2);
      const Eigen::Vector2d off_m = leg_of(side).center_world_m - position(middle) - sign * person.leg_offset_world_m;
      person.leg_offset_world_m += sign * gain * off_m;
      variance_m2 *= 1.0 - gain;
    }
    seen.view = seen.middle;
    seen.view.R.topLeftCorner<2, 2>() = kHips_m * kHips_m * Eigen::Matrix2d::Identity();
    seen_.push_back(seen);
  }
  return seen_;
}

bool People::may_be_leg(std::size_t detection, const std::vector<MapElement>& elements) const {
  const Leg& leg = legs_[detection];
  if (!leg.may_be_one && !leg.may_be_both) return false;
  return std::any_of(seen_.begin(), seen_.end(), [&](const SeenLegs& seen) {
    const MapElement& person = elements[seen.element];
    return (seen.legs < 2 || person.estimate.p_moving > 0.5) &&
           (position(combine(person.estimate)) - leg.center_world_m).norm() < kReach_m;
  });
}

}  // namespace situation_awareness
