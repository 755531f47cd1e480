// SPDX-License-Identifier: BSD-3-Clause
// Association against all possible matchings, on small random problems.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/estimation/gating.hpp"
#include "situation_awareness/map/objects/association.hpp"
#include "situation_awareness/map/objects/object_map.hpp"
#include "situation_awareness/map/objects/visibility.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "support/covariance.hpp"
#include "support/level_scene.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness::association_test {
namespace {

using namespace object_state;

constexpr std::int64_t kStart_ns = 1'000'000'000;
constexpr double kSightMargin_m = 0.1;

/// Elements for which only the likelihood ratio decides: all were seen just now and surely exist.
ObjectMapParams params() {
  ObjectMapParams result;
  result.measurement_sigma_m = 0.0;
  result.robot_position_sigma_m = result.robot_yaw_sigma_rad = 0.001;
  result.max_position_sigma_m = 10.0;
  return result;
}

/// Elements that were seen a moment ago, and detections among them.
struct Problem {
  std::vector<MapElement> elements;
  Detections detections;
};

MapElement random_element(const Eigen::Vector2d& near_m, double spread_m, double sigma, Random& random) {
  MapElement element;
  ObjectEstimate& standing = element.estimate.standing;
  standing.x.segment<2>(kPosition) = near_m + spread_m * normal_vector<2>(random);
  standing.x.segment<3>(kShape) << random.uniform(0.15, 0.3), random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05);
  standing.P = random_covariance<Matrix8d>(random, sigma);
  standing.P.middleRows<3>(kVelocity).setZero();
  standing.P.middleCols<3>(kVelocity).setZero();
  ObjectEstimate& moving = element.estimate.moving;
  moving.x = standing.x;
  moving.x.segment<2>(kPosition) += 0.05 * normal_vector<2>(random);
  moving.x.segment<2>(kVelocity) = normal_vector<2>(random);
  moving.P = random_covariance<Matrix8d>(random, 1.5 * sigma);
  element.estimate.p_moving = random.uniform(0.02, 0.98);
  element.P_view = 1e-4 * Matrix8d::Identity();
  element.log_odds = random.uniform(-1.5, 6.9);
  element.state = TrackState::kConfirmed;
  element.first_seen_ns = element.last_seen_ns = kStart_ns;
  element.observations = 10;
  return element;
}

/// Up to four elements and as many detections within about `spread_m` of one place, their state's standard deviations
/// about `sigma`. A detection is known by its number of hits.
void add_group(const Eigen::Vector2d& near_m, double spread_m, double sigma, Random& random, Problem& problem) {
  const auto up_to = [&](int most) { return 1 + static_cast<int>(random.uniform() * most); };
  for (int i = up_to(4); i > 0; --i) {
    problem.elements.push_back(random_element(near_m, spread_m, sigma, random));
    problem.elements.back().id = problem.elements.size();
  }
  for (int j = up_to(4); j > 0; --j) {
    Detection detection;
    const MapElement like = random_element(near_m, spread_m, sigma, random);
    detection.ellipse_level = inverse(problem.detections.T_world_level) * ellipse_world(like.estimate.standing.x);
    detection.covariance = random_covariance<Matrix5d>(random, sigma);
    detection.time_offset_s = random.uniform(0.0, 0.04);
    detection.beams = 100 + static_cast<int>(problem.detections.detections.size());
    problem.detections.detections.push_back(detection);
  }
}

/// A scan of the detections and of others beside them: some elements are then seen through, hit or hidden.
FreeSpace random_free_space(const Problem& problem, Random& random) {
  LevelScene scene;
  scene.beams = 361;
  scene.angle_min_rad = -kPi;
  scene.angle_increment_rad = radians(1.0);
  for (const Detection& detection : problem.detections.detections) scene.ellipses.push_back(detection.ellipse_level);
  if (random.uniform() < 0.5) scene.ellipses.push_back({{1.0, random.uniform(-0.5, 0.5)}, 0.0, 0.2, 0.2});
  return free_space(project_horizontally(scene.scan(), Eigen::Isometry3d::Identity()));
}

Problem random_problem(Random& random) {
  Problem problem;
  problem.detections.stamp_ns = kStart_ns;
  problem.detections.T_world_level = {{random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)},
                                      random.uniform(-0.5, 0.5)};
  const double sigma = std::exp(random.uniform(std::log(0.002), std::log(0.1)));
  add_group({4.0, 0.0}, random.uniform(1.0, 4.0) * sigma, sigma, random, problem);
  problem.detections.free_space = random_free_space(problem, random);
  return problem;
}

/// The detection, by its number of hits, that each matched element was corrected by, by its id.
using Matching = std::map<std::uint64_t, int>;

Matching matching_of(const Problem& problem) {
  MapSnapshot snapshot;
  snapshot.world_frame = "world";
  snapshot.stamp_ns = kStart_ns;
  snapshot.elements = problem.elements;
  snapshot.next_id = problem.elements.size() + 1;
  ObjectMap map{params()};
  map.resume(snapshot);  // no time passes before the update
  const ObjectMapUpdate update = map.update(problem.detections);
  Matching result;
  for (std::uint64_t k = 0; k < update.matches; ++k) {  // those that reinitialise an element follow
    const std::uint64_t id = update.updated[k];
    for (const MapElement& element : map.snapshot().elements) {
      if (element.id == id) result[id] = element.beams;
    }
  }
  return result;
}

/// The logarithm of P_D N(nu; 0, S) / (lambda P_miss) (docs/math/objects.md, "Association"); none outside the gate.
std::optional<double> log_ratio_of(const MapElement& element, const Detection& detection, const Detections& scan) {
  const ObjectMapParams p = params();
  Eigen::Matrix3d U = Eigen::Matrix3d::Zero();
  U.diagonal() << std::pow(p.robot_position_sigma_m, 2), std::pow(p.robot_position_sigma_m, 2),
      std::pow(p.robot_yaw_sigma_rad, 2);
  const MotionMatch pair = match(element.estimate, scan.T_world_level, measurement_of(detection), U);
  const double gate = chi_square_quantile(p.gate_probability, kMeasurementSize);
  if (pair.standing.mahalanobis2 > gate && pair.moving.mahalanobis2 > gate) return std::nullopt;

  const ObjectEstimate& estimate =
      element.estimate.p_moving > 0.5 ? element.estimate.moving : element.estimate.standing;
  const Ellipse ellipse = ellipse_world(estimate.x);
  const Eigen::Matrix2d P = estimate.P.block<2, 2>(kPosition, kPosition);
  const double variance_m2 = P.trace() - smallest_eigenvalue(P);
  const double area_m2 = ellipse.rx_m * ellipse.ry_m;
  double p_miss = 1.0;
  if (look_at(inverse(scan.T_world_level) * ellipse, scan.free_space, kSightMargin_m) != Sight::kHidden) {
    p_miss -= p.detection_probability * area_m2 / (area_m2 + variance_m2);
  }
  return std::log(p.detection_probability) + pair.log_likelihood - kLogNewObjectDensity - std::log(p_miss);
}

/// Largest sum of logarithmic likelihood ratios over all matchings from the `i`th element on.
double best_sum(const std::vector<std::vector<std::optional<double>>>& log_ratio, std::size_t i,
                std::set<std::size_t>& taken) {
  if (i == log_ratio.size()) return 0.0;
  double best = best_sum(log_ratio, i + 1, taken);
  for (std::size_t j = 0; j < log_ratio[i].size(); ++j) {
    if (!log_ratio[i][j] || !taken.insert(j).second) continue;
    best = std::max(best, *log_ratio[i][j] + best_sum(log_ratio, i + 1, taken));
    taken.erase(j);
  }
  return best;
}

TEST(Association, IsTheMostProbableOfAllMatchings) {
  Random random(3);
  int alone_though_in_the_gate = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const Problem problem = random_problem(random);
    std::vector<std::vector<std::optional<double>>> log_ratio;
    for (const MapElement& element : problem.elements) {
      log_ratio.emplace_back();
      for (const Detection& detection : problem.detections.detections) {
        log_ratio.back().push_back(log_ratio_of(element, detection, problem.detections));
      }
    }
    std::set<std::size_t> taken;
    const double best = best_sum(log_ratio, 0, taken);

    const Matching matching = matching_of(problem);
    double sum = 0.0;
    for (const auto& [id, beams] : matching) {
      const auto j = static_cast<std::size_t>(beams - 100);
      const std::optional<double> own = log_ratio[id - 1][j];
      ASSERT_TRUE(own.has_value()) << trial << ": outside the gate";
      EXPECT_GT(*own, 0.0) << trial << ": no better than a new object";
      EXPECT_TRUE(taken.insert(j).second) << trial << ": one detection for two elements";
      sum += *own;
    }
    EXPECT_NEAR(sum, best, 1e-9) << trial;
    const std::size_t most = std::min(problem.elements.size(), problem.detections.detections.size());
    alone_though_in_the_gate += matching.size() < most && best > 0.0 ? 1 : 0;
  }
  EXPECT_GT(alone_though_in_the_gate, 50);
}

TEST(Association, AGroupElsewhereChangesNothing) {
  Random random(4);
  std::size_t matched = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    Problem problem = random_problem(random);
    const Matching alone = matching_of(problem);
    const std::size_t here = problem.elements.size();
    add_group({40.0, random.uniform(-40.0, 40.0)}, 0.5, 0.2, random, problem);
    Matching with_others = matching_of(problem);
    with_others.erase(with_others.upper_bound(here), with_others.end());
    EXPECT_EQ(with_others, alone) << trial;
    matched += alone.size();
  }
  EXPECT_GT(matched, 1000U);
}

}  // namespace
}  // namespace situation_awareness::association_test
