// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/ellipse_posterior.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>

#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::ellipse_posterior_test {
namespace {

SegmentModel circle_model() {
  SegmentModel model;
  model.shape = ObjectShape::kCircle;
  model.min_hits = 4;
  return model;
}

double azimuth(const SegmentModel& model, int beam) { return model.first_azimuth_rad + beam * model.resolution_rad; }

std::optional<double> range_along(const SegmentModel& model, int beam, const Ellipse& ellipse) {
  const double angle = azimuth(model, beam);
  return intersect_ray(ellipse, Eigen::Vector2d::Zero(), {std::cos(angle), std::sin(angle)});
}

/// The model's observation, beam by beam, of an object of known shape and position; nothing if it is not kept.
std::optional<SegmentObservation> observe(const SegmentModel& model, const Ellipse& ellipse, bool occluded,
                                          Random& random) {
  constexpr int kPlaces = 720;
  for (int i = 0; i < kPlaces; ++i) {
    const double angle = 2.0 * kPi * i / kPlaces;
    const Eigen::Vector2d own(ellipse.rx_m * std::cos(angle), ellipse.ry_m * std::sin(angle));
    const double distance = (ellipse.center_m + Eigen::Rotation2Dd(ellipse.psi_rad) * own).norm();
    if (distance < model.min_range_m || distance > model.max_range_m) return std::nullopt;
  }
  if (contains(ellipse, Eigen::Vector2d::Zero())) return std::nullopt;
  if (range_along(model, 0, ellipse) || range_along(model, model.beams - 1, ellipse)) return std::nullopt;
  SegmentObservation result;
  // Beams that could meet the circle about it.
  const double bearing = std::atan2(ellipse.center_m.y(), ellipse.center_m.x());
  const double half_width = std::asin(std::min(1.0, ellipse.rx_m / ellipse.center_m.norm()));
  const int first = static_cast<int>((bearing - half_width - model.first_azimuth_rad) / model.resolution_rad) - 1;
  const int last = static_cast<int>((bearing + half_width - model.first_azimuth_rad) / model.resolution_rad) + 1;
  for (int beam = std::max(first, 0); beam <= std::min(last, model.beams - 1); ++beam) {
    const std::optional<double> range_m = range_along(model, beam, ellipse);
    if (!range_m) continue;
    if (result.ranges_m.empty()) result.first_beam = beam;
    result.ranges_m.push_back(*range_m + model.range_sigma_m * random.normal());
  }
  const int n = static_cast<int>(result.ranges_m.size());
  if (n < model.min_hits) return std::nullopt;
  if (!occluded) return result;
  std::vector<int> choices;
  for (int hidden = 0; hidden <= n - model.min_hits; ++hidden) {
    if (hidden >= model.min_hidden_share * n && hidden <= model.max_hidden_share * n) choices.push_back(hidden);
  }
  if (choices.empty()) return std::nullopt;
  const int hidden = choices[static_cast<std::size_t>(random.uniform() * static_cast<double>(choices.size()))];
  result.blocked_beams = hidden + static_cast<int>(random.uniform() * (model.max_beyond_beams + 1));
  if (random.uniform() < 0.5) {
    result.hidden_end = HiddenEnd::kRight;
    result.first_beam += hidden;
    result.ranges_m.erase(result.ranges_m.begin(), result.ranges_m.begin() + hidden);
  } else {
    result.hidden_end = HiddenEnd::kLeft;
    result.ranges_m.resize(static_cast<std::size_t>(n - hidden));
  }
  return result;
}

struct Sample {
  Ellipse truth;
  SegmentObservation observation;
};

/// A draw of the whole model, from the prior on.
Sample draw_sample(const SegmentModel& model, bool occluded, Random& random) {
  while (true) {
    Sample sample;
    const double distance = model.max_range_m * std::sqrt(random.uniform());
    const double bearing = random.uniform(azimuth(model, 0), azimuth(model, model.beams - 1));
    sample.truth.center_m = distance * Eigen::Vector2d(std::cos(bearing), std::sin(bearing));
    sample.truth.rx_m = sample.truth.ry_m = random.uniform(model.min_radius_m, model.max_radius_m);
    if (model.shape == ObjectShape::kEllipse) {
      sample.truth.psi_rad = random.uniform(-kPi / 2.0, kPi / 2.0);
      sample.truth.ry_m = random.uniform(model.min_radius_m, sample.truth.rx_m);
    }
    if (const auto observation = observe(model, sample.truth, occluded, random)) {
      sample.observation = *observation;
      return sample;
    }
  }
}

Sample sample_of(const SegmentModel& model, const Ellipse& truth, bool occluded, std::uint64_t seed) {
  Random random(seed);
  return {truth, observe(model, truth, occluded, random).value()};
}

/// Probability of the observation given the ellipse, up to a constant, beam by beam.
double likelihood(const SegmentModel& model, const SegmentObservation& observation, const Ellipse& ellipse) {
  const int first = observation.first_beam;
  const int visible = static_cast<int>(observation.ranges_m.size());
  const auto hits = [&](int beam) { return range_along(model, beam, ellipse).has_value(); };
  const bool right = observation.hidden_end == HiddenEnd::kRight;
  const bool left = observation.hidden_end == HiddenEnd::kLeft;
  if (!hits(first) || !hits(first + visible - 1)) return 0.0;
  if (!right && hits(first - 1)) return 0.0;
  if (!left && hits(first + visible)) return 0.0;
  double probability = 1.0;
  if (right || left) {
    int hidden = 0;
    while (hits(right ? first - 1 - hidden : first + visible + hidden)) ++hidden;
    const int beyond = observation.blocked_beams - hidden;
    if (beyond < 0 || beyond > model.max_beyond_beams) return 0.0;
    const int n = visible + hidden;
    if (hidden < model.min_hidden_share * n || hidden > model.max_hidden_share * n) return 0.0;
    int choices = 0;
    for (int h = 0; h <= n - model.min_hits; ++h) {
      if (h >= model.min_hidden_share * n && h <= model.max_hidden_share * n) ++choices;
    }
    probability = 1.0 / choices;
  }
  double chi2 = 0.0;
  for (int i = 0; i < visible; ++i) {
    const std::optional<double> range_m = range_along(model, first + i, ellipse);
    if (!range_m) return 0.0;
    chi2 += std::pow((*range_m - observation.ranges_m[static_cast<std::size_t>(i)]) / model.range_sigma_m, 2);
  }
  return probability * std::exp(-0.5 * chi2);
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
  explicit Tally(const Ellipse& estimate, DetectionLoss loss) : estimate_(estimate), loss_(loss) {}

  void add(const Ellipse& ellipse, double weight) {
    if (weight == 0.0) return;
    weights_ += weight;
    squared_weights_ += weight * weight;
    sum_ += weight * smooth_parameters(ellipse);
    squares_ += weight * smooth_parameters(ellipse).cwiseAbs2();
    losses_ += weight * loss_of(loss_, estimate_, ellipse);
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
  DetectionLoss loss_;
  double weights_ = 0.0;
  double squared_weights_ = 0.0;
  Vector5d sum_ = Vector5d::Zero();
  Vector5d squares_ = Vector5d::Zero();
  double losses_ = 0.0;
};

/// Domain of the brute force: near_m, the nearest distance of the ellipse along the x axis, y_m of its centre, psi,
/// rx, and v with ry = rmin + v (rx - rmin). The prior is uniform in them.
struct Box {
  Vector5d low;
  Vector5d high;

  static Vector5d place(const SegmentModel& model, const Ellipse& ellipse) {
    Vector5d y;
    y << ellipse.center_m.x() - std::sqrt(shape_matrix(ellipse)(0, 0)), ellipse.center_m.y(), ellipse.psi_rad,
        ellipse.rx_m, (ellipse.ry_m - model.min_radius_m) / (ellipse.rx_m - model.min_radius_m);
    return y;
  }

  Ellipse draw(const SegmentModel& model, Random& random) const {
    Vector5d y;
    for (int i = 0; i < 5; ++i) y(i) = random.uniform(low(i), high(i));
    Ellipse ellipse{{0.0, y(1)}, y(2), y(3), model.min_radius_m + y(4) * (y(3) - model.min_radius_m)};
    ellipse.center_m.x() = y(0) + std::sqrt(shape_matrix(ellipse)(0, 0));
    return ellipse;
  }
};

/// Any orientation and shape up to a radius.
Box box_of(double near_low_m, double near_high_m, double y_low_m, double y_high_m, double max_radius_m) {
  Box box;
  box.low << near_low_m, y_low_m, -kPi / 2.0, 0.05, 0.0;
  box.high << near_high_m, y_high_m, kPi / 2.0, max_radius_m, 1.0;
  return box;
}

/// The prior's own draws in a box, weighted by the likelihood: nothing in common with the sampler but the model.
Moments brute_force(const SegmentModel& model, const SegmentObservation& observation, const Box& box,
                    const Tally& empty, int draws, Random& random) {
  Tally tally = empty;
  for (int i = 0; i < draws; ++i) {
    const Ellipse ellipse = box.draw(model, random);
    tally.add(ellipse, likelihood(model, observation, ellipse));
  }
  return tally.moments();
}

void expect_same(const Moments& a, const Moments& b) {
  const double samples = std::min(a.effective_samples, b.effective_samples);
  ASSERT_GT(samples, 500.0);
  for (int i = 0; i < 5; ++i) {
    const double deviation = std::max(a.deviation(i), 1e-9);
    EXPECT_NEAR(a.mean(i), b.mean(i), 5.0 * deviation / std::sqrt(samples)) << "parameter " << i;
    EXPECT_NEAR(a.deviation(i), b.deviation(i), 5.0 * deviation / std::sqrt(samples)) << "parameter " << i;
  }
  EXPECT_NEAR(a.expected_loss, b.expected_loss, 5.0 * a.expected_loss / std::sqrt(samples));
}

Moments moments_of(const EllipsePosterior& posterior, const Ellipse& estimate, DetectionLoss loss) {
  Tally tally(estimate, loss);
  for (const Ellipse& draw : posterior.draws) tally.add(draw, 1.0);
  Moments moments = tally.moments();
  moments.effective_samples = std::min(posterior.effective_samples, moments.effective_samples);
  return moments;
}

void expect_brute_force_agrees(const SegmentModel& model, const SegmentObservation& observation, const Box& box,
                               int draws) {
  Random random(101);
  const EllipsePosterior posterior = sample_posterior(observation, model, 3000.0, 4096, random);
  for (const Ellipse& draw : posterior.draws) {
    const Vector5d y = Box::place(model, draw);
    ASSERT_TRUE(((y - box.low).array() > 0.0).all() && ((box.high - y).array() > 0.0).all()) << y.transpose();
  }
  const Ellipse estimate = bayes_estimate(DetectionLoss::kSymmetric, posterior.draws);
  const Tally empty(estimate, DetectionLoss::kSymmetric);
  expect_same(moments_of(posterior, estimate, DetectionLoss::kSymmetric),
              brute_force(model, observation, box, empty, draws, random));
}

// Two metres away, with much noise: the shape depends on the prior as much as on the hits.
TEST(EllipsePosterior, AgreesWithBruteForce) {
  SegmentModel model;
  model.range_sigma_m = 0.04;
  const Sample sample = sample_of(model, {{2.0, 0.012}, 0.5, 0.15, 0.09}, false, 3);
  expect_brute_force_agrees(model, sample.observation, box_of(1.80, 1.93, 0.0, 0.025, 0.4), 3000000);
}

TEST(EllipsePosterior, AgreesWithBruteForceWhereAnEndIsHidden) {
  SegmentModel model;
  model.range_sigma_m = 0.04;
  for (const std::uint64_t seed : {5U, 6U}) {
    SCOPED_TRACE(seed);
    const Sample sample = sample_of(model, {{2.5, 0.01}, -0.4, 0.2, 0.12}, true, seed);
    expect_brute_force_agrees(model, sample.observation, box_of(2.08, 2.38, -0.09, 0.07, 0.5), 3000000);
  }
}

// Few hits on a thin ellipse end on: they determine the tangents so well that there are few effective samples, and
// chains are used.
TEST(EllipsePosterior, AgreesWithBruteForceWhereChainsAreUsed) {
  const SegmentModel model;
  const Sample sample = sample_of(model, {{7.957, 0.0046}, -0.011, 0.4932, 0.109}, false, 1);
  Box box;
  box.low << 7.444, -0.003, -0.08, 0.35, 0.11;
  box.high << 7.490, 0.010, 0.01, 0.5, 0.17;
  expect_brute_force_agrees(model, sample.observation, box, 6000000);
}

TEST(CirclePosterior, AgreesWithADenseGrid) {
  const SegmentModel model = circle_model();
  const Ellipse truth{{4.0, 0.02}, 0.0, 0.12, 0.12};
  const Sample sample = sample_of(model, truth, false, 4);
  Random random(102);
  const EllipsePosterior posterior = sample_posterior(sample.observation, model, 8000.0, 16384, random);
  const Ellipse estimate = bayes_estimate(DetectionLoss::kCircle, posterior.draws);
  Tally tally(estimate, DetectionLoss::kCircle);
  constexpr int kSteps = 80;
  constexpr int kStepsAcross = 160;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      for (int k = 0; k < kStepsAcross; ++k) {
        const double radius = 0.07 + 0.1 * (i + 0.5) / kSteps;
        const double x = 3.85 + radius + 0.06 * (j + 0.5) / kSteps;
        const double y = 0.005 + 0.03 * (k + 0.5) / kStepsAcross;
        const Ellipse circle{{x, y}, 0.0, radius, radius};
        tally.add(circle, likelihood(model, sample.observation, circle));
      }
    }
  }
  Moments grid = tally.moments();
  grid.effective_samples = 1e9;
  expect_same(moments_of(posterior, estimate, DetectionLoss::kCircle), grid);
  // The mean is the estimate of least squared error, and its error the trace of the covariance.
  const Ellipse mean = bayes_estimate(DetectionLoss::kCircleSquared, posterior.draws);
  EXPECT_NEAR(expected_loss(DetectionLoss::kCircleSquared, mean, posterior.draws),
              grid.deviation.head<3>().squaredNorm(), 0.1 * grid.deviation.head<3>().squaredNorm());
}

/// One run of the whole experiment: expected and achieved loss.
struct Calibration {
  std::vector<double> expected;
  std::vector<double> achieved;
  std::array<std::array<int, 10>, 5> ranks{};  ///< of the truth among the draws, in tenths
};

Calibration calibrate(const SegmentModel& model, bool occluded, DetectionLoss loss, int samples) {
  Calibration result;
  Random random(7);
  for (int i = 0; i < samples; ++i) {
    const Sample sample = draw_sample(model, occluded, random);
    const EllipsePosterior posterior = sample_posterior(sample.observation, model, 1000.0, 2048, random);
    const EllipsePosterior judge = sample_posterior(sample.observation, model, 1000.0, 2048, random);
    const Ellipse estimate = bayes_estimate(loss, posterior.draws);
    result.expected.push_back(expected_loss(loss, estimate, judge.draws));
    result.achieved.push_back(loss_of(loss, estimate, sample.truth));
    // In the frame of the segment, so that the hidden corners are where the sensor has them.
    const Pose2 T_segment_sensor{Eigen::Vector2d::Zero(), -azimuth(model, sample.observation.first_beam)};
    const auto seen = [&](const Ellipse& ellipse) {
      Vector5d y = smooth_parameters(T_segment_sensor * ellipse);
      if (model.shape == ObjectShape::kCircle) y.tail<2>().setZero();
      return y;
    };
    const Vector5d truth = seen(sample.truth);
    for (int k = 0; k < 5; ++k) {
      double below = random.uniform();
      for (const Ellipse& draw : judge.draws) below += seen(draw)(k) < truth(k) ? 1.0 : 0.0;
      const double rank = below / static_cast<double>(judge.draws.size() + 1);
      ++result.ranks[static_cast<std::size_t>(k)][static_cast<std::size_t>(10.0 * rank)];
    }
  }
  return result;
}

/// On average the estimate's error is that expected by its posterior, and the truth is one draw among the others.
void expect_calibrated(const Calibration& calibration, int parameters) {
  const auto n = static_cast<double>(calibration.expected.size());
  double sum = 0.0;
  double squares = 0.0;
  double expected = 0.0;
  for (std::size_t i = 0; i < calibration.expected.size(); ++i) {
    const double excess = calibration.achieved[i] - calibration.expected[i];
    sum += excess;
    squares += excess * excess;
    expected += calibration.expected[i];
  }
  const double error = std::sqrt(squares / n) / std::sqrt(n);
  EXPECT_LT(std::abs(sum / n), 3.5 * error) << "expected " << expected / n << ", excess " << sum / n;
  for (int k = 0; k < parameters; ++k) {
    double chi2 = 0.0;
    for (const int count : calibration.ranks[static_cast<std::size_t>(k)]) {
      chi2 += std::pow(count - 0.1 * n, 2) / (0.1 * n);
    }
    EXPECT_LT(chi2, chi_square_quantile(0.9995, 9.0)) << "parameter " << k;
  }
}

TEST(EllipsePosterior, IsCalibrated) {
  expect_calibrated(calibrate(SegmentModel{}, false, DetectionLoss::kSymmetric, 160), 5);
}

TEST(EllipsePosterior, IsCalibratedWhereAnEndIsHidden) {
  expect_calibrated(calibrate(SegmentModel{}, true, DetectionLoss::kOrdered, 160), 5);
}

TEST(CirclePosterior, IsCalibrated) {
  expect_calibrated(calibrate(circle_model(), false, DetectionLoss::kCircleSquared, 250), 3);
}

TEST(EllipsePosterior, TurnsWithTheScene) {
  const SegmentModel model;
  for (const bool occluded : {false, true}) {
    const Ellipse truth{{3.0, 0.3}, 0.4, 0.3, 0.15};
    const Sample sample = sample_of(model, truth, occluded, 9);
    constexpr int kTurn = 250;
    SegmentObservation turned = sample.observation;
    turned.first_beam += kTurn;
    Random random(10);
    Random same_random(10);
    const EllipsePosterior posterior = sample_posterior(sample.observation, model, 500.0, 256, random);
    const EllipsePosterior of_turned = sample_posterior(turned, model, 500.0, 256, same_random);
    const Pose2 T{Eigen::Vector2d::Zero(), kTurn * model.resolution_rad};
    for (std::size_t i = 0; i < posterior.draws.size(); ++i) {
      EXPECT_LT(symmetric_characteristic_distance(T * posterior.draws[i], of_turned.draws[i]), 1e-9);
    }
  }
}

// A scene and its mirror image have mirrored posteriors: the two ends are treated alike.
TEST(EllipsePosterior, IsMirroredWithTheScene) {
  const SegmentModel model;
  const Sample sample = sample_of(model, {{3.0, 0.0}, 0.4, 0.3, 0.15}, true, 11);
  SegmentObservation mirrored = sample.observation;
  std::reverse(mirrored.ranges_m.begin(), mirrored.ranges_m.end());
  mirrored.first_beam =
      model.beams - sample.observation.first_beam - static_cast<int>(sample.observation.ranges_m.size());
  mirrored.hidden_end = sample.observation.hidden_end == HiddenEnd::kLeft ? HiddenEnd::kRight : HiddenEnd::kLeft;
  Random random(12);
  EllipsePosterior posterior = sample_posterior(sample.observation, model, 8000.0, 8192, random);
  const EllipsePosterior of_mirrored = sample_posterior(mirrored, model, 8000.0, 8192, random);
  for (Ellipse& draw : posterior.draws) {
    draw.center_m.y() *= -1.0;
    draw.psi_rad *= -1.0;
  }
  const Ellipse estimate = bayes_estimate(DetectionLoss::kSymmetric, posterior.draws);
  expect_same(moments_of(posterior, estimate, DetectionLoss::kSymmetric),
              moments_of(of_mirrored, estimate, DetectionLoss::kSymmetric));
}

TEST(EllipsePosterior, IsTheSameForTheSameSeed) {
  const SegmentModel model;
  const Sample sample = sample_of(model, {{3.0, 0.005}, 0.7, 0.056, 0.053}, false, 1);
  Random a(13);
  Random b(13);
  const EllipsePosterior first = sample_posterior(sample.observation, model, 500.0, 512, a);
  const EllipsePosterior second = sample_posterior(sample.observation, model, 500.0, 512, b);
  EXPECT_EQ(first.effective_samples, second.effective_samples);
  for (std::size_t i = 0; i < first.draws.size(); ++i) {
    EXPECT_EQ(first.draws[i].center_m, second.draws[i].center_m);
    EXPECT_EQ(first.draws[i].psi_rad, second.draws[i].psi_rad);
  }
  EXPECT_EQ(a.uniform(), b.uniform());
}

// Runs of other random numbers find the same floor, also where few draws count and where an end is hidden.
TEST(EllipsePosterior, RunsAgree) {
  const SegmentModel model;
  Random random(14);
  double sum_a = 0.0;
  double sum_b = 0.0;
  for (int i = 0; i < 60; ++i) {
    const Sample sample = draw_sample(model, i % 2 == 1, random);
    const EllipsePosterior a = sample_posterior(sample.observation, model, 3000.0, 4096, random);
    const EllipsePosterior b = sample_posterior(sample.observation, model, 3000.0, 4096, random);
    const Ellipse estimate = bayes_estimate(DetectionLoss::kSymmetric, a.draws);
    const Ellipse other = bayes_estimate(DetectionLoss::kSymmetric, b.draws);
    const double loss_a = expected_loss(DetectionLoss::kSymmetric, estimate, b.draws);
    const double loss_b = expected_loss(DetectionLoss::kSymmetric, other, a.draws);
    EXPECT_GE(std::min(a.effective_samples, b.effective_samples), 1500.0);
    EXPECT_NEAR(loss_a, loss_b, 0.1 * loss_a) << "sample " << i;
    sum_a += loss_a;
    sum_b += loss_b;
  }
  EXPECT_NEAR(sum_a, sum_b, 0.01 * sum_a);
}

// For truths of every spread, none of many other estimates is better: neither near it nor far, nor one of the truths.
TEST(BayesEstimate, IsNotBeaten) {
  Random random(15);
  for (const bool occluded : {false, true}) {
    for (int i = 0; i < 10; ++i) {
      const Sample sample = draw_sample(SegmentModel{}, occluded, random);
      const EllipsePosterior posterior = sample_posterior(sample.observation, SegmentModel{}, 1000.0, 1024, random);
      for (const DetectionLoss loss : {DetectionLoss::kOrdered, DetectionLoss::kSymmetric}) {
        const Ellipse best = bayes_estimate(loss, posterior.draws);
        const double least = expected_loss(loss, best, posterior.draws);
        const double slack = 2e-3 * least;
        for (std::size_t k = 0; k < posterior.draws.size(); k += 8) {
          EXPECT_GT(expected_loss(loss, posterior.draws[k], posterior.draws), least - slack);
          Ellipse near = best;
          const double step = std::pow(10.0, random.uniform(-4.0, -1.0));
          near.center_m += step * Eigen::Vector2d(random.normal(), random.normal());
          near.psi_rad += 3.0 * step * random.normal();
          near.rx_m += step * random.normal();
          near.ry_m += step * random.normal();
          EXPECT_GT(expected_loss(loss, near, posterior.draws), least - slack);
        }
      }
    }
  }
}

// Half of the truths at either end of the range of psi are the same axis: the symmetric loss is invariant, the ordered
// one must hedge.
TEST(BayesEstimate, HedgesWhereTheOrderIsUnknown) {
  std::vector<Ellipse> truths;
  for (int i = 0; i < 100; ++i) truths.push_back({{2.0, 0.0}, (i % 2 == 0 ? 1.0 : -1.0) * kPi / 2.0, 0.4, 0.1});
  const Ellipse symmetric = bayes_estimate(DetectionLoss::kSymmetric, truths);
  EXPECT_LT(expected_loss(DetectionLoss::kSymmetric, symmetric, truths), 1e-4);
  // Any point between the two ends of an axis is as good: half the distance of the ends on average.
  const Ellipse ordered = bayes_estimate(DetectionLoss::kOrdered, truths);
  EXPECT_NEAR(expected_loss(DetectionLoss::kOrdered, ordered, truths), 0.5 * (0.4 + 0.1), 1e-4);
}

TEST(SegmentModel, RefusesImpossibleObservations) {
  SegmentModel model;
  Random random(16);
  SegmentObservation observation;
  observation.first_beam = 500;
  observation.ranges_m = {3.0, 2.9, 2.9};
  EXPECT_THROW(sample_posterior(observation, model, 100.0, 100, random), std::invalid_argument);
  observation.ranges_m = {3.0, 2.9, 2.9, 2.9, 3.0};
  observation.hidden_end = HiddenEnd::kLeft;
  observation.blocked_beams = 1;  // 30 % of six beams are two
  EXPECT_THROW(sample_posterior(observation, model, 100.0, 100, random), std::invalid_argument);
  observation.hidden_end = HiddenEnd::kNone;
  observation.first_beam = 0;  // the right tangent would be beyond the field of view
  EXPECT_THROW(sample_posterior(observation, model, 100.0, 100, random), std::invalid_argument);
  model.max_radius_m = model.min_radius_m;
  EXPECT_THROW(model.validate(), std::invalid_argument);
  model = {};
  model.range_sigma_m = 0.0;
  EXPECT_THROW(model.validate(), std::invalid_argument);
  EXPECT_THROW(bayes_estimate(DetectionLoss::kOrdered, {}), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::ellipse_posterior_test
