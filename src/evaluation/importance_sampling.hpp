// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/evaluation/ellipse_posterior.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/ellipse.hpp"

namespace situation_awareness {

constexpr double kImpossible = -std::numeric_limits<double>::infinity();

/// A weighted draw; its ellipse is seen from the segment's middle and not yet canonical.
struct Draw {
  Ellipse ellipse;
  double log_weight = kImpossible;
};

/// Azimuths of the beams from the segment's middle, and their ranges.
struct Hits {
  Eigen::ArrayXd azimuth_rad;
  Eigen::ArrayXd cos;
  Eigen::ArrayXd sin;
  Eigen::ArrayXd range_m;

  Hits(const SegmentObservation& observation, const SegmentModel& model) {
    const auto n = static_cast<Eigen::Index>(observation.ranges_m.size());
    azimuth_rad = (Eigen::ArrayXd::LinSpaced(n, 0.0, static_cast<double>(n - 1)) - 0.5 * static_cast<double>(n - 1)) *
                  model.resolution_rad;
    cos = azimuth_rad.cos();
    sin = azimuth_rad.sin();
    range_m = Eigen::Map<const Eigen::ArrayXd>(observation.ranges_m.data(), n);
  }
};

/// Student's t in `Dimensions` dimensions: as a proposal its tails are heavier than any Gaussian likelihood's.
template <int Dimensions>
struct StudentT {
  using Vector = Eigen::Matrix<double, Dimensions, 1>;

  static Vector draw(Random& random) {
    Vector normal;
    for (int i = 0; i < Dimensions; ++i) normal(i) = random.normal();
    // A chi-square of 2 k degrees of freedom is -2 log of the product of k uniform numbers.
    double product = 1.0;
    for (int i = 0; i < kPairs; ++i) product *= 1.0 - random.uniform();
    return normal * std::sqrt(kFreedom / (-2.0 * std::log(product)));
  }

  static double log_density(const Vector& t) {
    static const double log_height = std::lgamma(0.5 * (kFreedom + Dimensions)) - std::lgamma(0.5 * kFreedom) -
                                     0.5 * Dimensions * std::log(kFreedom * kPi);
    return log_height - 0.5 * (kFreedom + Dimensions) * std::log1p(t.squaredNorm() / kFreedom);
  }

 private:
  static constexpr int kPairs = 4;
  static constexpr double kFreedom = 2.0 * kPairs;
};

inline double log_of_sum(double log_a, double log_b) {
  const double top = std::max(log_a, log_b);
  return top == kImpossible ? top : top + std::log(std::exp(log_a - top) + std::exp(log_b - top));
}

/// `count` indices, i with a frequency that is its weight's share of the sum, at equal steps from a random start.
inline std::vector<std::size_t> pick(const std::vector<double>& weights, std::size_t count, Random& random) {
  const double step = std::accumulate(weights.begin(), weights.end(), 0.0) / static_cast<double>(count);
  const double start = random.uniform();
  std::vector<std::size_t> picked;
  picked.reserve(count);
  double sum = 0.0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    sum += weights[i];
    while (picked.size() < count && (static_cast<double>(picked.size()) + start) * step < sum) picked.push_back(i);
  }
  while (picked.size() < count) picked.push_back(picked.empty() ? 0 : picked.back());  // the sum's last bit
  return picked;
}

/// Weighted draws in units of the largest weight.
struct Population {
  std::vector<Ellipse> ellipses;
  std::vector<double> weights;

  double effective_samples() const {
    double sum = 0.0;
    double sum_of_squares = 0.0;
    for (const double weight : weights) {
      sum += weight;
      sum_of_squares += weight * weight;
    }
    return sum > 0.0 ? sum * sum / sum_of_squares : 0.0;
  }
};

/// Importance sampling of a mixture: the cells of a proposal by their share, and draws in a cell by the proposal, which
/// has
///
///   std::size_t cells() const
///   void draw_group(std::size_t cell, double share, Random&, std::vector<Draw>&)   appends a few draws, whose weight
///   is
///                                                                                  the density over the proposal's
template <class Proposal>
class ImportanceSampler {
 public:
  explicit ImportanceSampler(Proposal& proposal) : proposal_(proposal), shares_(proposal.cells(), 1.0) {}

  /// Shares after the root mean square weight of a few draws per cell, which makes the variance least.
  void adapt(Random& random) {
    constexpr int kGroupsPerCell = 4;
    constexpr double kFloor = 0.1;
    std::vector<double> log_rms(shares_.size(), kImpossible);
    for (std::size_t i = 0; i < shares_.size(); ++i) {
      draws_.clear();
      for (int group = 0; group < kGroupsPerCell; ++group) proposal_.draw_group(i, 1.0, random, draws_);
      double top = kImpossible;
      for (const Draw& draw : draws_) top = std::max(top, draw.log_weight);
      if (top == kImpossible) continue;
      double sum = 0.0;
      for (const Draw& draw : draws_) sum += std::exp(2.0 * (draw.log_weight - top));
      log_rms[i] = top + 0.5 * std::log(sum);
    }
    draws_.clear();
    const double top = *std::max_element(log_rms.begin(), log_rms.end());
    double sum = 0.0;
    for (const double value : log_rms) sum += top == kImpossible ? 1.0 : std::exp(value - top);
    const double uniform_share = 1.0 / static_cast<double>(shares_.size());
    for (std::size_t i = 0; i < shares_.size(); ++i) {
      const double own = top == kImpossible ? 1.0 : std::exp(log_rms[i] - top);
      shares_[i] = kFloor * uniform_share + (1.0 - kFloor) * own / sum;
    }
  }

  Population sample(double effective_samples, Random& random) {
    constexpr std::size_t kGroupsPerRound = 1024;
    const auto most = static_cast<std::size_t>(100.0 * effective_samples);
    while (true) {
      for (const std::size_t i : pick(shares_, kGroupsPerRound, random)) {
        proposal_.draw_group(i, shares_[i], random, draws_);
      }
      Population population = weighted();
      if (population.effective_samples() >= effective_samples || draws_.size() >= most) return population;
    }
  }

 private:
  Population weighted() const {
    double top = kImpossible;
    for (const Draw& draw : draws_) top = std::max(top, draw.log_weight);
    Population population;
    if (top == kImpossible) return population;
    for (const Draw& draw : draws_) {
      const double weight = std::exp(draw.log_weight - top);
      if (weight == 0.0) continue;
      population.ellipses.push_back(draw.ellipse);
      population.weights.push_back(weight);
    }
    return population;
  }

  Proposal& proposal_;
  std::vector<double> shares_;
  std::vector<Draw> draws_;
};

/// `count` draws of equal weight. Throws std::invalid_argument if there are none.
inline EllipsePosterior equally_weighted(const Population& population, std::size_t count, Random& random) {
  if (population.ellipses.empty()) throw std::invalid_argument("observation: no object of the model explains it");
  EllipsePosterior posterior;
  posterior.effective_samples = population.effective_samples();
  posterior.draws.reserve(count);
  for (const std::size_t i : pick(population.weights, count, random)) posterior.draws.push_back(population.ellipses[i]);
  return posterior;
}

/// From the frame of the segment's middle, in which hits and draws are, to the sensor's.
inline Pose2 middle_in_sensor(const SegmentObservation& observation, const SegmentModel& model) {
  const double middle = observation.first_beam + 0.5 * static_cast<double>(observation.ranges_m.size() - 1);
  return {Eigen::Vector2d::Zero(), model.first_azimuth_rad + middle * model.resolution_rad};
}

}  // namespace situation_awareness
