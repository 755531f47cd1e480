// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/dogleg.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/degenerate_segments.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::dogleg_test {
namespace {

/// Points of an arc of the curve, its first point at `first_deg` of the ellipse's own frame, off it by up to
/// `roughness` of the radii.
std::vector<Eigen::Vector2d> arc(const Ellipse& ellipse, double first_deg, double length_deg, int count,
                                 double roughness = 0.0) {
  std::vector<Eigen::Vector2d> points_m;
  for (int k = 0; k < count; ++k) {
    const double angle_rad = radians(first_deg + length_deg * k / count);
    const double scale = 1.0 + roughness * std::sin(7.0 * k);
    const Eigen::Vector2d own(ellipse.rx_m * std::cos(angle_rad), ellipse.ry_m * std::sin(angle_rad));
    points_m.push_back(ellipse.center_m + Eigen::Rotation2Dd(ellipse.psi_rad) * (scale * own));
  }
  return points_m;
}

Ellipse random_ellipse(Random& random) {
  return {{random.uniform(-6.0, 6.0), random.uniform(-6.0, 6.0)},
          random.uniform(-kPi / 2.0, kPi / 2.0),
          random.uniform(0.06, 0.48),
          random.uniform(0.06, 0.48)};
}

TEST(Dogleg, RecoversExactEllipsesSeenFromAllAround) {
  Random random(1);
  for (int i = 0; i < 300; ++i) {
    const Ellipse truth = random_ellipse(random);
    const DoglegFit fit = fit_dogleg(arc(truth, 0.0, 360.0, 40), {});
    EXPECT_LT(symmetric_characteristic_distance(canonical(truth), fit.ellipse_level), 1e-6) << i;
  }
}

// Where it stops at a bound, or at a circle of the largest radius, whose psi is free, the result depends on rounding:
// in about one of a hundred of these fits, and in others on each kind of processor.
TEST(Dogleg, TurnsWithTheScene) {
  Random random(2);
  int turned_too = 0;
  for (int i = 0; i < 300; ++i) {
    const Ellipse truth = random_ellipse(random);
    const Pose2 rotation{Eigen::Vector2d::Zero(), random.uniform(-kPi, kPi)};
    std::vector<Eigen::Vector2d> points_m = arc(truth, random.uniform(0.0, 360.0), 150.0, 30, 0.03);
    const DoglegFit fit = fit_dogleg(points_m, {});
    for (Eigen::Vector2d& point_m : points_m) point_m = rotation * point_m;
    const DoglegFit turned = fit_dogleg(points_m, {});
    if (symmetric_characteristic_distance(rotation * fit.ellipse_level, turned.ellipse_level) < 1e-6 &&
        std::abs(fit.cost - turned.cost) <= 1e-9 * fit.cost) {
      ++turned_too;
    }
  }
  EXPECT_GE(turned_too, 291);
}

TEST(Dogleg, KeepsItsBoundsAndUsesThem) {
  Random random(3);
  const DoglegParams params;
  int at_bound = 0;
  for (int i = 0; i < 300; ++i) {
    const DoglegFit fit = fit_dogleg(arc(random_ellipse(random), random.uniform(0.0, 360.0), 120.0, 20, 0.05), params);
    const Ellipse& ellipse = fit.ellipse_level;
    EXPECT_LE(ellipse.rx_m, params.max_radius_m);
    EXPECT_GE(ellipse.ry_m, params.min_radius_m);
    EXPECT_LE(fit.evaluations, params.max_evaluations);
    if (ellipse.rx_m == params.max_radius_m || ellipse.ry_m == params.min_radius_m) ++at_bound;
  }
  EXPECT_GT(at_bound, 30);

  // Twice as large as allowed, and beyond the range: the answer is the nearest allowed one.
  const DoglegFit large = fit_dogleg(arc({{3.0, 0.0}, 0.0, 1.0, 1.0}, 0.0, 360.0, 40), params);
  EXPECT_EQ(large.ellipse_level.rx_m, params.max_radius_m);
  EXPECT_EQ(large.ellipse_level.ry_m, params.max_radius_m);
  const DoglegFit far = fit_dogleg(arc({{10.1, 0.0}, 0.0, 0.3, 0.3}, 0.0, 360.0, 40), params);
  EXPECT_EQ(far.ellipse_level.center_m.x(), params.max_range_m);
}

// Inside the bounds (and psi has bounds in the frame of the fit) no small change of any parameter lowers the cost.
TEST(Dogleg, EndsWhereTheCostIsStationary) {
  Random random(4);
  const auto cost_of = [](const Vector5d& x, const std::vector<Eigen::Vector2d>& points_m) {
    const Eigen::Matrix2d M = shape_matrix({x.head<2>(), x(2), x(3), x(4)}).inverse();
    double sum = 0.0;
    for (const Eigen::Vector2d& point_m : points_m) {
      const Eigen::Vector2d d = point_m - x.head<2>();
      sum += std::pow(d.dot(M * d) - 1.0, 2);
    }
    return 0.5 * sum;
  };
  int at_bound = 0;
  for (int i = 0; i < 100; ++i) {
    const Ellipse truth = random_ellipse(random);
    const std::vector<Eigen::Vector2d> points_m = arc(truth, 0.0, 360.0, 30, 0.05);
    DoglegParams params;
    params.max_radius_m = 1.0;
    params.min_radius_m = 0.01;
    const DoglegFit fit = fit_dogleg(points_m, params);
    Vector5d x;
    Eigen::Vector2d mean_m = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& point_m : points_m) mean_m += point_m;
    const double psi_fit_rad = fit.ellipse_level.psi_rad - std::atan2(mean_m.y(), mean_m.x());
    if (std::abs(std::sin(2.0 * psi_fit_rad)) < 1e-9 || fit.ellipse_level.rx_m > params.max_radius_m - 1e-9) {
      ++at_bound;
      continue;
    }
    x << fit.ellipse_level.center_m, fit.ellipse_level.psi_rad, fit.ellipse_level.rx_m, fit.ellipse_level.ry_m;
    EXPECT_NEAR(cost_of(x, points_m), fit.cost, 1e-9);
    for (int k = 0; k < 5; ++k) {
      for (const double change : {-1e-3, 1e-3}) {
        EXPECT_GE(cost_of(x + change * Vector5d::Unit(k), points_m), fit.cost - 1e-12);
      }
    }
  }
  EXPECT_LT(at_bound, 10);
}

// The costs are those of scipy 1.10.1 on the same points in the frame of the fit (turned by minus the azimuth of their
// mean), with half the extents there as radii and the analytic Jacobian:
//   least_squares(residuals, x0, jacobian, (lower, upper), 'dogbox').cost
//   x0 = clip([norm(mean) + behind * half[1], 0, 0, half[0], half[1]], lower, upper)
//   lower = [-10, -10, -pi/2, 0.05, 0.05], upper = [10, 10, pi/2, 0.5, 0.5]
// They end inside the bounds, on one bound (rx, ry or psi) or on two.
TEST(Dogleg, AgreesWithScipyDogbox) {
  struct Problem {
    Ellipse ellipse;
    double first_deg;
    double length_deg;
    double cost_from_mean;
    double cost_from_behind;
  };
  const Problem problems[] = {
      {{{2.0, 0.0}, 0.5, 0.4, 0.2}, 200.0, 160.0, 0.000404504470751, 0.862250941282},
      {{{3.0, 1.0}, -1.0, 0.3, 0.1}, 150.0, 120.0, 0.00130116841833, 0.0013709808335},
      {{{1.0, -2.0}, 0.0, 0.25, 0.25}, 40.0, 100.0, 0.000824415223846, 0.000824415223847},
      {{{5.0, 2.0}, 1.2, 0.45, 0.08}, 130.0, 110.0, 0.722371924601, 0.161653963834},
      {{{4.0, -3.0}, -0.3, 0.2, 0.15}, 0.0, 360.0, 0.000837649404616, 0.000837649404616},
      {{{2.0, 2.0}, 0.7, 0.6, 0.3}, 150.0, 150.0, 0.00291778530299, 0.00291778530295},
  };
  for (const Problem& problem : problems) {
    const std::vector<Eigen::Vector2d> points_m = arc(problem.ellipse, problem.first_deg, problem.length_deg, 12, 0.03);
    DoglegParams params;
    EXPECT_NEAR(fit_dogleg(points_m, params).cost, problem.cost_from_mean, 1e-6 * problem.cost_from_mean);
    params.start_behind = 1.0;
    EXPECT_NEAR(fit_dogleg(points_m, params).cost, problem.cost_from_behind, 1e-6 * problem.cost_from_behind);
  }
}

TEST(DoglegDetector, GivesAFiniteDetectionOrARefusalOfDegenerateSegments) {
  DoglegDetector detector({}, {});
  expect_degenerate_segments_are_survived(detector);
}

TEST(DoglegDetector, DetectionsHaveACovarianceAndASmallResidual) {
  Random random(5);
  LevelScene scene;
  scene.ellipses = {{{2.0, 0.0}, 0.4, 0.3, 0.2}, {{0.0, -3.0}, 0.0, 0.2, 0.2}};
  const Segments segments =
      segment(project_horizontally(scene.scan(&random), Eigen::Isometry3d::Identity()), SegmentationParams{});
  ASSERT_EQ(segments.segments.size(), 2U);
  DoglegDetector detector({}, {});
  const Detections detections = detector.detect(segments);
  ASSERT_EQ(detections.detections.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    const Detection& detection = detections.detections[i];
    EXPECT_EQ(detection.segment, i);
    EXPECT_EQ(detection.beams, static_cast<int>(segments.segments[i].count));
    EXPECT_LT(detection.residual_rms_m, 0.02);
    EXPECT_EQ(Eigen::LLT<Matrix5d>(detection.covariance).info(), Eigen::Success);
  }
}

TEST(DoglegParams, RefusesWrongValuesByName) {
  DoglegParams params;
  params.tolerance = 0.0;
  EXPECT_THROW(DoglegDetector(params, {}), std::invalid_argument);
  params = {};
  params.min_radius_m = params.max_radius_m;
  EXPECT_THROW(DoglegDetector(params, {}), std::invalid_argument);
}

}  // namespace
}  // namespace situation_awareness::dogleg_test
