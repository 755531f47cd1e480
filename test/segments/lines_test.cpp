// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/segments/lines.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include <Eigen/Dense>

#include "situation_awareness/geometry/angles.hpp"
#include "support/covariance.hpp"
#include "support/level_scene.hpp"
#include "support/segment_scan.hpp"

namespace situation_awareness::lines_test {
namespace {

constexpr double kSigma_m = 0.01;

/// A wall by its normal's azimuth and its distance, and where along it, counter-clockwise, it begins and ends.
struct Wall {
  double azimuth_rad;
  double distance_m;
  double from_m;
  double to_m;

  Line line() const {
    const Eigen::Vector2d normal(std::cos(azimuth_rad), std::sin(azimuth_rad));
    return {distance_m * normal, normal};
  }
};

/// A random one with angles of incidence of 13 degrees or more.
Wall random_wall(Random& random) {
  const double distance_m = random.uniform(1.0, 5.0);
  const double from_m = distance_m * random.uniform(-4.0, 3.0);
  return {random.uniform(-kPi, kPi), distance_m, from_m, from_m + distance_m * random.uniform(0.3, 1.0)};
}

Point point_at(double azimuth_rad, double range_m) {
  Point point;
  point.azimuth_rad = azimuth_rad;
  point.range_m = range_m;
  point.p_level_m = range_m * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad));
  point.state = BeamState::kHit;
  return point;
}

/// `count` hits at equal steps of azimuth from a scanner at the origin; exact ones where sigma_m is 0.
std::vector<Point> hits_on(const Wall& wall, std::size_t count, double sigma_m, Random& random) {
  const double right_rad = std::atan2(wall.from_m, wall.distance_m);
  const double left_rad = std::atan2(wall.to_m, wall.distance_m);
  std::vector<Point> points;
  for (std::size_t i = 0; i < count; ++i) {
    const double turn_rad =
        right_rad + (left_rad - right_rad) * static_cast<double>(i) / static_cast<double>(count - 1);
    points.push_back(
        point_at(wall.azimuth_rad + turn_rad, wall.distance_m / std::cos(turn_rad) + sigma_m * random.normal()));
  }
  return points;
}

/// Error of an estimate: offset of the true line along the normal at `through_m`, and its rotation.
Eigen::Vector2d error_of(const Line& estimate, const Line& truth) {
  const double turn_rad = std::atan2(estimate.normal.x() * truth.normal.y() - estimate.normal.y() * truth.normal.x(),
                                     estimate.normal.dot(truth.normal));
  return {-offset_m(truth, estimate.through_m) / truth.normal.dot(estimate.normal), turn_rad};
}

TEST(FitLine, IsTheFirstPrincipalComponent) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const std::vector<Point> points = hits_on(random_wall(random), 20, 0.05, random);
    Eigen::MatrixX2d rows(20, 2);
    for (int k = 0; k < 20; ++k) rows.row(k) = points[static_cast<std::size_t>(k)].p_level_m.transpose();
    const Eigen::RowVector2d mean = rows.colwise().mean();
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(rows.rowwise() - mean, Eigen::ComputeThinU | Eigen::ComputeThinV);
    const Line line = fit_line(points.data(), points.size());
    EXPECT_LT((line.through_m - mean.transpose()).norm(), 1e-12);
    EXPECT_NEAR(std::abs(line.normal.dot(svd.matrixV().col(1))), 1.0, 1e-12);
    EXPECT_NEAR(rms_m(line, points.data(), points.size()), svd.singularValues()(1) / std::sqrt(20.0), 1e-9);
  }
}

TEST(EstimateLine, IsExactWhereRangesAre) {
  Random random(2);
  for (int i = 0; i < 100; ++i) {
    const Wall wall = random_wall(random);
    const std::vector<Point> points = hits_on(wall, 30, 0.0, random);
    const LineEstimate estimate = estimate_line(points.data(), points.size(), kSigma_m);
    EXPECT_LT(error_of(estimate.line_level, wall.line()).norm(), 1e-12);
    EXPECT_TRUE(is_covariance(estimate.covariance));
  }
}

/// The line of least squared range residuals, by its normal's azimuth and its distance: Gauss-Newton with numerical
/// derivatives and more steps than needed.
Line maximum_likelihood(const std::vector<Point>& points, Wall at) {
  const auto residuals = [&](double azimuth_rad, double distance_m) {
    Eigen::VectorXd r(static_cast<Eigen::Index>(points.size()));
    for (std::size_t i = 0; i < points.size(); ++i) {
      r(static_cast<Eigen::Index>(i)) = points[i].range_m - distance_m / std::cos(points[i].azimuth_rad - azimuth_rad);
    }
    return r;
  };
  for (int step = 0; step < 20; ++step) {
    constexpr double kStep = 1e-6;
    const auto derivative = [&](double d_rad, double d_m) {
      return ((residuals(at.azimuth_rad + d_rad, at.distance_m + d_m) -
               residuals(at.azimuth_rad - d_rad, at.distance_m - d_m)) /
              (2.0 * kStep))
          .eval();
    };
    Eigen::MatrixX2d J(static_cast<Eigen::Index>(points.size()), 2);
    J << derivative(kStep, 0.0), derivative(0.0, kStep);
    const Eigen::Vector2d change = J.colPivHouseholderQr().solve(residuals(at.azimuth_rad, at.distance_m));
    at.azimuth_rad -= change.x();
    at.distance_m -= change.y();
  }
  return at.line();
}

TEST(EstimateLine, IsTheMaximumLikelihoodLine) {
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    const Wall wall = random_wall(random);
    const std::vector<Point> points = hits_on(wall, 40, kSigma_m, random);
    const LineEstimate estimate = estimate_line(points.data(), points.size(), kSigma_m);
    const Eigen::Vector2d apart = error_of(estimate.line_level, maximum_likelihood(points, wall));
    const Eigen::Vector2d sigma = estimate.covariance.diagonal().cwiseSqrt();
    EXPECT_LT(std::abs(apart.x()), 0.01 * sigma.x()) << i;
    EXPECT_LT(std::abs(apart.y()), 0.01 * sigma.y()) << i;
  }
}

// NEES, 2 degrees of freedom: the mean over n draws lies within 2 +- 5 * 2 / sqrt(n), and no component has a bias.
TEST(EstimateLine, ItsCovarianceIsThatOfItsErrors) {
  constexpr int kDraws = 20000;
  Random random(4);
  double nees = 0.0;
  Eigen::Vector2d normalised = Eigen::Vector2d::Zero();
  for (int i = 0; i < kDraws; ++i) {
    const Wall wall = random_wall(random);
    const std::vector<Point> points = hits_on(wall, 10 + static_cast<std::size_t>(i % 200), kSigma_m, random);
    const LineEstimate estimate = estimate_line(points.data(), points.size(), kSigma_m);
    const Eigen::Vector2d error = error_of(estimate.line_level, wall.line());
    nees += mahalanobis2(error, estimate.covariance);
    // A turn towards the far end counts alike on both sides.
    const double side = wall.from_m + wall.to_m > 0.0 ? 1.0 : -1.0;
    normalised +=
        error.cwiseProduct(Eigen::Vector2d(1.0, side)).cwiseQuotient(estimate.covariance.diagonal().cwiseSqrt());
  }
  const double tolerance = 5.0 / std::sqrt(static_cast<double>(kDraws));
  EXPECT_NEAR(nees / kDraws, 2.0, 2.0 * tolerance);
  EXPECT_NEAR(normalised.x() / kDraws, 0.0, tolerance);
  EXPECT_NEAR(normalised.y() / kDraws, 0.0, tolerance);
}

TEST(EstimateLine, TurnsWithItsHits) {
  Random random(5);
  for (int i = 0; i < 100; ++i) {
    const std::vector<Point> points = hits_on(random_wall(random), 30, kSigma_m, random);
    const LineEstimate estimate = estimate_line(points.data(), points.size(), kSigma_m);
    const Pose2 turn{Eigen::Vector2d::Zero(), random.uniform(-kPi, kPi)};
    std::vector<Point> turned;
    for (const Point& point : points) turned.push_back(point_at(point.azimuth_rad + turn.yaw_rad, point.range_m));
    const LineEstimate after = estimate_line(turned.data(), turned.size(), kSigma_m);
    EXPECT_LT((after.line_level.through_m - turn * estimate.line_level.through_m).norm(), 1e-10);
    EXPECT_LT((after.line_level.normal - turn * estimate.line_level.normal).norm(), 1e-10);
    EXPECT_LT((after.covariance - estimate.covariance).norm(), 1e-9 * estimate.covariance.norm());
  }
}

std::vector<StraightPiece> pieces_of(const LevelScene& scene, Random* random = nullptr) {
  return with_straight_pieces(segment_scan(scene.scan(random)), {}, kSigma_m).straight_pieces;
}

TEST(StraightPieces, AreTheWallsOfARoomAndEndAtItsCorners) {
  LevelScene scene;  // looks to all sides but the back: the wall there is not in sight
  scene.walls = {{{4, -3}, {4, 3}}, {{4, 3}, {-4, 3}}, {{-4, 3}, {-4, -3}}, {{-4, -3}, {4, -3}}};
  Random random(6);
  for (int i = 0; i < 50; ++i) {
    const std::vector<StraightPiece> pieces = pieces_of(scene, &random);
    ASSERT_EQ(pieces.size(), 3U);
    const double normals_deg[] = {-90.0, 0.0, 90.0};
    const double distances_m[] = {3.0, 4.0, 3.0};
    for (std::size_t k = 0; k < 3; ++k) {
      const StraightPiece& piece = pieces[k];
      const Line truth = Wall{radians(normals_deg[k]), distances_m[k], 0.0, 0.0}.line();
      EXPECT_EQ(piece.segment, 0U);
      EXPECT_GT(piece.line_level.normal.dot(truth.normal), 0.9999);
      EXPECT_LT(piece.rms_m, 1.5 * kSigma_m);
      EXPECT_EQ(piece.right_end, k == 0 ? SegmentEnd::kScanEdge : SegmentEnd::kContinues);
      EXPECT_EQ(piece.left_end, k == 2 ? SegmentEnd::kScanEdge : SegmentEnd::kContinues);
      if (k == 0) continue;
      EXPECT_EQ(piece.first, pieces[k - 1].first + pieces[k - 1].count);
      const Eigen::Vector2d corner(4.0, k == 1 ? -3.0 : 3.0);
      EXPECT_LT((piece.right_level_m - corner).norm(), 0.1);  // beams are 3 to 4 cm apart there
      EXPECT_LT((pieces[k - 1].left_level_m - corner).norm(), 0.1);
    }
  }
}

// From the scan on: pieces split at corners have errors as large as their covariance, too.
TEST(StraightPieces, HaveTheCovarianceOfTheirErrors) {
  Random random(7);
  double nees = 0.0;
  int pieces = 0;
  for (int i = 0; i < 400; ++i) {
    const Pose2 turn{{random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)}, random.uniform(-kPi, kPi)};
    const std::vector<Eigen::Vector2d> corners = {{4, -3}, {4, 3}, {-4, 3}, {-4, -3}};
    LevelScene scene;
    for (std::size_t k = 0; k < 4; ++k) scene.walls.push_back({turn * corners[k], turn * corners[(k + 1) % 4]});
    for (const StraightPiece& piece : pieces_of(scene, &random)) {
      double best = 1e9;
      for (const LevelScene::Wall& wall : scene.walls) {
        const Eigen::Vector2d direction = (wall.to - wall.from).normalized();
        Line truth{wall.from, {direction.y(), -direction.x()}};  // away from the inside
        const Eigen::Vector2d error = error_of(piece.line_level, truth);
        best = std::min(best, mahalanobis2(error, piece.covariance));
      }
      nees += best;
      ++pieces;
    }
  }
  ASSERT_GT(pieces, 1200);
  EXPECT_NEAR(nees / pieces, 2.0, 5.0 * 2.0 / std::sqrt(pieces));
}

TEST(StraightPieces, HaveTheKindsOfTheirEnds) {
  LevelScene scene;
  scene.walls = {{{4.0, -3.0}, {4.0, 2.0}}, {{7.0, 1.0}, {7.0, 6.0}}};
  scene.ellipses = {{{2.0, -0.5}, 0.0, 0.15, 0.15}};
  const std::vector<StraightPiece> pieces = pieces_of(scene);
  ASSERT_EQ(pieces.size(), 3U);
  EXPECT_EQ(pieces[0].right_end, SegmentEnd::kFree);
  EXPECT_EQ(pieces[0].left_end, SegmentEnd::kOccluded);
  EXPECT_EQ(pieces[1].right_end, SegmentEnd::kOccluded);
  EXPECT_EQ(pieces[1].left_end, SegmentEnd::kBackground);
  EXPECT_EQ(pieces[2].right_end, SegmentEnd::kOccluded);
  EXPECT_EQ(pieces[2].left_end, SegmentEnd::kFree);
  EXPECT_NEAR(pieces[0].right_level_m.y(), -3.0, 0.04);
  EXPECT_NEAR(pieces[1].left_level_m.y(), 2.0, 0.04);
}

// A few hits off a wall, by a handle or mixed pixels, neither split it nor bias it.
TEST(StraightPieces, ContinueAcrossAFewHitsOffTheirLine) {
  LevelScene scene;
  scene.walls = {{{3.0, -2.0}, {3.0, 2.0}}};
  Random random(8);
  for (int i = 0; i < 50; ++i) {
    Scan scan = scene.scan(&random);
    const auto at = static_cast<std::size_t>(540.0 + random.uniform(-80.0, 80.0));
    for (std::size_t k = at; k < at + 3; ++k) scan.beams[k].range_m -= 0.12F;
    const Segments segments = with_straight_pieces(segment_scan(scan), {}, kSigma_m);
    ASSERT_EQ(segments.segments.size(), 1U);
    ASSERT_EQ(segments.straight_pieces.size(), 1U);
    const StraightPiece& piece = segments.straight_pieces[0];
    EXPECT_EQ(piece.count, segments.segments[0].count);
    const Eigen::Vector2d error = error_of(piece.line_level, {{3.0, 0.0}, {1.0, 0.0}});
    EXPECT_LT(mahalanobis2(error, piece.covariance), 25.0);
  }
}

TEST(StraightPieces, FollowACurve) {
  LevelScene scene;
  scene.ellipses = {{{5.0, 0.0}, 0.0, 2.0, 2.0}};
  Random random(9);
  const SegmentationParams params;
  const Segments segments = with_straight_pieces(segment_scan(scene.scan(&random)), params, kSigma_m);
  ASSERT_EQ(segments.segments.size(), 1U);
  EXPECT_GE(segments.straight_pieces.size(), 3U);
  for (std::size_t k = 0; k < segments.straight_pieces.size(); ++k) {
    const StraightPiece& piece = segments.straight_pieces[k];
    EXPECT_LT(piece.rms_m, params.max_line_offset_m);
    EXPECT_GE(piece.count, static_cast<std::size_t>(params.min_line_points));
    if (k > 0) {
      EXPECT_EQ(piece.first, segments.straight_pieces[k - 1].first + segments.straight_pieces[k - 1].count);
    }
  }
}

TEST(StraightPieces, AroundAFullCircleNoneEndsAtTheSeam) {
  LevelScene scene;
  scene.beams = 720;
  scene.angle_increment_rad = radians(0.5);
  scene.angle_min_rad = -kPi;
  scene.walls = {{{4, -3}, {4, 3}}, {{4, 3}, {-4, 3}}, {{-4, 3}, {-4, -3}}, {{-4, -3}, {4, -3}}};
  const std::vector<StraightPiece> pieces = pieces_of(scene);
  ASSERT_EQ(pieces.size(), 5U);  // one wall lies across the seam
  for (const StraightPiece& piece : pieces) {
    EXPECT_EQ(piece.right_end, SegmentEnd::kContinues);
    EXPECT_EQ(piece.left_end, SegmentEnd::kContinues);
  }
}

TEST(StraightPieces, AreOfStructuresOnly) {
  LevelScene scene;
  scene.ellipses = {{{3.0, 0.0}, 0.0, 0.3, 0.2}};
  EXPECT_TRUE(pieces_of(scene).empty());
  EXPECT_TRUE(with_straight_pieces({}, {}, kSigma_m).straight_pieces.empty());
}

}  // namespace
}  // namespace situation_awareness::lines_test
