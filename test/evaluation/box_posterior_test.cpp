// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/box_posterior.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

#include "situation_awareness/evaluation/synthetic_segments.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/box.hpp"

namespace situation_awareness::box_posterior_test {
namespace {

double azimuth(const SegmentModel& model, int beam) { return model.first_azimuth_rad + beam * model.resolution_rad; }

/// Where a beam enters the box: the nearest crossing with one of its four edges.
std::optional<double> range_along(const SegmentModel& model, int beam, const Box& box) {
  const double angle = azimuth(model, beam);
  const Eigen::Vector2d u(std::cos(angle), std::sin(angle));
  const std::array<Eigen::Vector2d, 4> all = corners(box);
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Eigen::Vector2d along = all[(i + 1) % 4] - all[i];
    const double determinant = along.x() * u.y() - along.y() * u.x();
    const double range_m = (along.x() * all[i].y() - along.y() * all[i].x()) / determinant;
    const double place = (u.x() * all[i].y() - u.y() * all[i].x()) / determinant;
    if (range_m > 0.0 && place >= 0.0 && place <= 1.0) nearest = std::min(nearest, range_m);
  }
  return std::isfinite(nearest) ? std::optional(nearest) : std::nullopt;
}

int faces_seen(const Box& box) {
  const Eigen::Vector2d sensor_box = Eigen::Rotation2Dd(-box.psi_rad) * -box.center_m;
  return (std::abs(sensor_box.x()) > box.half_length_m ? 1 : 0) + (std::abs(sensor_box.y()) > box.half_width_m ? 1 : 0);
}

struct Interval {
  double low = 0.0;
  double high = 0.0;
};

/// Of a box of known place, beam by beam.
SegmentObservation observe(const SegmentModel& model, const Box& box, std::uint64_t seed) {
  Random random(seed);
  SegmentObservation result;
  for (int beam = 0; beam < model.beams; ++beam) {
    const std::optional<double> range_m = range_along(model, beam, box);
    if (!range_m) continue;
    if (result.ranges_m.empty()) result.first_beam = beam;
    result.ranges_m.push_back(*range_m + model.range_sigma_m * random.normal());
  }
  return result;
}

/// Probability of the observation given the box, up to a constant, beam by beam.
double likelihood(const SegmentModel& model, const SegmentObservation& observation, const Box& box, bool one_face) {
  const int first = observation.first_beam;
  const int visible = static_cast<int>(observation.ranges_m.size());
  if (one_face && faces_seen(box) != 1) return 0.0;
  if (range_along(model, first - 1, box) || range_along(model, first + visible, box)) return 0.0;
  double chi2 = 0.0;
  for (int i = 0; i < visible; ++i) {
    const std::optional<double> range_m = range_along(model, first + i, box);
    if (!range_m) return 0.0;
    chi2 += std::pow((*range_m - observation.ranges_m[static_cast<std::size_t>(i)]) / model.range_sigma_m, 2);
  }
  return std::exp(-0.5 * chi2);
}

struct Moments {
  Vector5d mean = Vector5d::Zero();
  Vector5d deviation = Vector5d::Zero();
  double expected_loss = 0.0;
  double effective_samples = 0.0;
};

/// Collects weighted ellipses.
class Tally {
 public:
  explicit Tally(const Ellipse& estimate) : estimate_(estimate) {}

  void add(const Ellipse& ellipse, double weight) {
    if (weight == 0.0) return;
    weights_ += weight;
    squared_weights_ += weight * weight;
    sum_ += weight * smooth_parameters(ellipse);
    squares_ += weight * smooth_parameters(ellipse).cwiseAbs2();
    losses_ += weight * loss_of(DetectionLoss::kSymmetric, estimate_, ellipse);
  }

  Moments moments() const {
    Moments result;
    result.mean = sum_ / weights_;
    result.deviation = (squares_ / weights_ - result.mean.cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
    result.expected_loss = losses_ / weights_;
    result.effective_samples = weights_ * weights_ / squared_weights_;
    return result;
  }

 private:
  Ellipse estimate_;
  double weights_ = 0.0;
  double squared_weights_ = 0.0;
  Vector5d sum_ = Vector5d::Zero();
  Vector5d squares_ = Vector5d::Zero();
  double losses_ = 0.0;
};

/// The prior's own draws, weighted by the likelihood: nothing in common with the sampler but the model. Of the four
/// parameter sets of a box one is drawn, so that the orientation has a quarter of the circle. Seen along the middle
/// beam, the centre is uniform in a rectangle outside of which no box gives the observation; its size is part of the
/// weight.
Moments brute_force(const SegmentModel& model, const SegmentObservation& observation, const BoxPrior& prior,
                    const Tally& empty, int draws, Random& random) {
  const double margin_m = 4.0 * model.range_sigma_m;
  const double nearest_m = *std::min_element(observation.ranges_m.begin(), observation.ranges_m.end());
  const int visible = static_cast<int>(observation.ranges_m.size());
  const double middle_rad = azimuth(model, observation.first_beam) + 0.5 * (visible - 1) * model.resolution_rad;
  const double half_rad = 0.5 * (visible + 1) * model.resolution_rad;
  const Interval near{std::cos(half_rad) * nearest_m - margin_m, nearest_m + margin_m};
  Tally tally = empty;
  for (int i = 0; i < draws; ++i) {
    Box box;
    box.psi_rad = random.uniform(0.0, kPi / 2.0);
    box.half_length_m = 0.5 * random.uniform(prior.min_side_m, prior.max_side_m);
    box.half_width_m = 0.5 * random.uniform(prior.min_side_m, prior.max_side_m);
    const double cos_psi = std::cos(box.psi_rad);
    const double sin_psi = std::sin(box.psi_rad);
    const double half_depth_m = box.half_length_m * cos_psi + box.half_width_m * sin_psi;
    const double half_breadth_m = box.half_length_m * sin_psi + box.half_width_m * cos_psi;
    // Its leftmost corner is between the last hit and the free beam beside it, at any depth that it has.
    const Interval left{near.low * std::tan(half_rad - model.resolution_rad),
                        (near.high + 2.0 * half_depth_m) * std::tan(half_rad)};
    box.center_m << random.uniform(near.low, near.high) + half_depth_m,
        random.uniform(left.low, left.high) - half_breadth_m;
    const Pose2 T_sensor_middle{Eigen::Vector2d::Zero(), middle_rad};
    const Box placed = T_sensor_middle * box;
    tally.add(canonical(moment_equal_ellipse(placed)),
              (left.high - left.low) * likelihood(model, observation, placed, prior.one_face));
  }
  return tally.moments();
}

/// Coarse and noisy, so that brute force finds enough boxes.
SegmentModel coarse_model() {
  SegmentModel model;
  model.resolution_rad = radians(2.5);
  model.beams = 109;
  model.range_sigma_m = 0.05;
  return model;
}

void expect_brute_force_agrees(const Box& truth, const BoxPrior& prior, std::uint64_t seed) {
  const SegmentModel model = coarse_model();
  const SegmentObservation observation = observe(model, truth, seed);
  ASSERT_GE(observation.ranges_m.size(), 5U);
  Random random(seed + 100);
  const EllipsePosterior posterior = sample_box_posterior(observation, model, prior, 4000.0, 8192, random);
  ASSERT_GE(posterior.effective_samples, 4000.0);
  const Ellipse estimate = bayes_estimate(DetectionLoss::kSymmetric, posterior.draws);
  Tally tally(estimate);
  for (const Ellipse& draw : posterior.draws) tally.add(draw, 1.0);
  const Moments sampled = tally.moments();
  const Moments expected = brute_force(model, observation, prior, Tally(estimate), 6000000, random);
  const double samples = std::min(posterior.effective_samples, expected.effective_samples);
  ASSERT_GT(samples, 1000.0);
  for (int i = 0; i < 5; ++i) {
    const double tolerance = 5.0 * expected.deviation(i) / std::sqrt(samples);
    EXPECT_NEAR(sampled.mean(i), expected.mean(i), tolerance) << "parameter " << i;
    EXPECT_NEAR(sampled.deviation(i), expected.deviation(i), tolerance) << "parameter " << i;
  }
  EXPECT_NEAR(sampled.expected_loss, expected.expected_loss, 5.0 * expected.expected_loss / std::sqrt(samples));
}

TEST(BoxPosterior, AgreesWithBruteForceWhereTwoFacesAreSeen) {
  expect_brute_force_agrees({{1.5, 0.02}, 0.6, 0.15, 0.2}, BoxPrior{0.1, 0.6, false}, 1);
}

TEST(BoxPosterior, AgreesWithBruteForceWhereTheSecondFaceIsUncertain) {
  expect_brute_force_agrees({{1.5, 0.01}, 0.12, 0.1, 0.15}, BoxPrior{0.1, 0.6, false}, 2);
}

TEST(BoxPosterior, AgreesWithBruteForceOfFaces) {
  expect_brute_force_agrees({{1.2, 0.02}, 0.05, 0.1, 0.2}, BoxPrior{0.1, 0.6, true}, 3);
}

/// The whole experiment: segments with known truth.
struct Drawn {
  SegmentModel model;
  SegmentObservation observation;
  Ellipse truth;
};

Drawn draw(SegmentCase which, std::uint64_t seed) {
  Random random(seed);
  const SyntheticSegment sample = draw_segment(which, random);
  Drawn drawn;
  drawn.truth = canonical(moment_equal_ellipse(*sample.box_level));
  drawn.observation.first_beam = sample.segments.points.front().beam;
  for (const Point& point : sample.segments.points) drawn.observation.ranges_m.push_back(point.range_m);
  return drawn;
}

TEST(BoxPosteriorLong, TruthsHaveUniformRanksAndTheExpectedLoss) {
  constexpr int kSegments = 300;
  for (const bool one_face : {false, true}) {
    SCOPED_TRACE(one_face);
    const BoxPrior prior{0.1, 1.5, one_face};
    std::array<std::array<int, 5>, 3> ranks{};  // of x, m and p in fifths
    double excess = 0.0;
    double excess_square = 0.0;
    for (int k = 0; k < kSegments; ++k) {
      const Drawn drawn =
          draw(one_face ? SegmentCase::kFaces : SegmentCase::kBoxes, 500 + static_cast<std::uint64_t>(k));
      Random random(static_cast<std::uint64_t>(k) + 9000);
      const auto sample = [&] {
        return sample_box_posterior(drawn.observation, drawn.model, prior, 500.0, 1024, random);
      };
      const EllipsePosterior chooser = sample();
      const EllipsePosterior judge = sample();
      const Ellipse estimate = bayes_estimate(DetectionLoss::kSymmetric, chooser.draws);
      const double difference = loss_of(DetectionLoss::kSymmetric, estimate, drawn.truth) -
                                expected_loss(DetectionLoss::kSymmetric, estimate, judge.draws);
      excess += difference / kSegments;
      excess_square += difference * difference / kSegments;
      const Pose2 T_segment_sensor{Eigen::Vector2d::Zero(), -azimuth(drawn.model, drawn.observation.first_beam)};
      const auto parameters = [&](const Ellipse& ellipse) {
        const Vector5d smooth = smooth_parameters(T_segment_sensor * ellipse);
        return std::array<double, 3>{smooth(0), smooth(2), smooth(3)};
      };
      const std::array<double, 3> truth = parameters(drawn.truth);
      for (std::size_t i = 0; i < truth.size(); ++i) {
        int below = 0;
        for (const Ellipse& draw : judge.draws) below += parameters(draw)[i] < truth[i] ? 1 : 0;
        ++ranks[i][std::min<std::size_t>(4, static_cast<std::size_t>(below) * 5 / judge.draws.size())];
      }
    }
    EXPECT_LT(std::abs(excess), 4.0 * std::sqrt(excess_square / kSegments));
    for (const std::array<int, 5>& counts : ranks) {
      double chi2 = 0.0;
      for (const int count : counts) chi2 += std::pow(count - kSegments / 5.0, 2) / (kSegments / 5.0);
      EXPECT_LT(chi2, 18.5);  // 99.9 % of 4 degrees of freedom
    }
  }
}

TEST(BoxPosterior, RefusesWhatTheModelCannotGive) {
  const SegmentModel model;
  Random random(1);
  SegmentObservation observation{
      400, {2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0}, HiddenEnd::kNone, 0};
  EXPECT_NO_THROW(sample_box_posterior(observation, model, {}, 100.0, 100, random));
  EXPECT_THROW(sample_box_posterior(observation, model, {0.5, 0.2, false}, 100.0, 100, random), std::invalid_argument);
  observation.hidden_end = HiddenEnd::kLeft;
  EXPECT_THROW(sample_box_posterior(observation, model, {}, 100.0, 100, random), std::invalid_argument);
  observation = {0, observation.ranges_m, HiddenEnd::kNone, 0};
  EXPECT_THROW(sample_box_posterior(observation, model, {}, 100.0, 100, random), std::invalid_argument);
  observation = {400, {2.0, 2.0, 2.0}, HiddenEnd::kNone, 0};
  EXPECT_THROW(sample_box_posterior(observation, model, {}, 100.0, 100, random), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::box_posterior_test
