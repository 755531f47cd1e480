// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/polylines/polyline_extraction.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/segments/segmentation.hpp"
#include "support/covariance.hpp"
#include "support/level_scene.hpp"
#include "support/refusal.hpp"

namespace situation_awareness::polyline_extraction_test {
namespace {

constexpr double kSigma_m = 0.012;

Segments segments_of(const LevelScene& scene, Random* random = nullptr) {
  return segment(project_horizontally(scene.scan(random, kSigma_m), Eigen::Isometry3d::Identity()), {});
}

Polylines polylines_of(const LevelScene& scene, Random* random = nullptr) {
  return extract_polylines(segments_of(scene, random), {});
}

/// Two walls that meet at `corner_m`, seen from outside.
LevelScene corner_scene(const Eigen::Vector2d& corner_m, double turn_rad) {
  LevelScene scene;
  const Eigen::Rotation2Dd turn(turn_rad);
  scene.walls.push_back({corner_m + turn * Eigen::Vector2d(1.0, 1.0), corner_m});
  scene.walls.push_back({corner_m, corner_m + turn * Eigen::Vector2d(1.0, -1.0)});
  return scene;
}

TEST(PolylineExtraction, AWallIsOneEdgeUpToItsEnds) {
  LevelScene scene;
  scene.walls.push_back({{2.0, -1.0}, {2.5, 1.2}});
  const Polylines polylines = polylines_of(scene);
  ASSERT_EQ(polylines.polylines.size(), 1U);
  ASSERT_EQ(polylines.vertices.size(), 2U);
  EXPECT_LT((polylines.vertices[0].p_level_m - scene.walls[0].from).norm(), 0.02);  // a beam's spacing
  EXPECT_LT((polylines.vertices[1].p_level_m - scene.walls[0].to).norm(), 0.02);
  EXPECT_EQ(polylines.polylines[0].right_end, SegmentEnd::kFree);
  const Eigen::Vector2d along = (scene.walls[0].to - scene.walls[0].from).normalized();
  for (const PolylineHit& hit : polylines.hits) {
    ASSERT_TRUE(hit.has_normal);
    EXPECT_NEAR(hit.normal_level.dot(along), 0.0, 1e-6);
    EXPECT_LT(hit.normal_level.dot(hit.p_level_m), 0.0);  // towards the sensor
  }
}

// The error of the corner is as large as its covariance says: chi-square of 2.
TEST(PolylineExtraction, ACornerIsWhereTheEdgesMeetWithAnHonestCovariance) {
  Random random(1);
  double nees = 0.0;
  int corners = 0;
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector2d corner_m(random.uniform(1.5, 4.0), random.uniform(-0.5, 0.5));
    const LevelScene scene = corner_scene(corner_m, random.uniform(-0.4, 0.4));
    const Polylines polylines = polylines_of(scene, &random);
    if (polylines.polylines.size() != 1U || polylines.vertices.size() != 3U) continue;
    const PolylineVertex& vertex = polylines.vertices[1];
    EXPECT_LT((vertex.p_level_m - corner_m).norm(), 0.03);
    nees += mahalanobis2(vertex.p_level_m - corner_m, vertex.covariance);
    ++corners;
  }
  ASSERT_GT(corners, 250);
  EXPECT_GT(nees / corners, 1.4);
  EXPECT_LT(nees / corners, 3.2);  // a hit at the corner may be on the wrong edge
}

TEST(PolylineExtraction, EveryHitIsOnAPolylineOrRefused) {
  Random random(2);
  for (int i = 0; i < 50; ++i) {
    LevelScene scene;
    scene.max_range_m = 8.0;
    for (int k = 0; k < 12; ++k) {
      const Eigen::Vector2d from(random.uniform(-6.0, 6.0), random.uniform(-6.0, 6.0));
      if (from.norm() < 0.5) continue;
      scene.walls.push_back({from, from + Eigen::Vector2d(random.normal(), random.normal())});
    }
    const Segments segments = segments_of(scene, &random);
    const Polylines polylines = extract_polylines(segments, {});
    std::uint64_t refused = 0;
    for (const auto& [reason, count] : polylines.refused) refused += count;
    EXPECT_EQ(polylines.hits.size() + refused, segments.points.size());
    std::size_t hits = 0, vertices = 0;
    for (const Polyline& polyline : polylines.polylines) {
      EXPECT_EQ(polyline.first_hit, hits);
      EXPECT_EQ(polyline.first_vertex, vertices);
      EXPECT_GE(polyline.vertices, polyline.hits == 1U ? 1U : 2U);
      hits += polyline.hits;
      vertices += polyline.vertices;
    }
    EXPECT_EQ(hits, polylines.hits.size());
    EXPECT_EQ(vertices, polylines.vertices.size());
  }
}

// A beam that meets the edge of a near wall may end between it and the wall behind.
TEST(PolylineExtraction, LeavesOutAHitBetweenTwoSurfaces) {
  LevelScene scene;
  scene.walls.push_back({{2.0, -1.0}, {2.0, 0.0}});
  scene.walls.push_back({{4.0, -4.0}, {4.0, 4.0}});
  Scan scan = scene.scan();
  std::size_t edge = 0;  // the first beam beside the near wall
  for (std::size_t i = 1; i < scan.beams.size(); ++i) {
    if (scan.beams[i].range_m - scan.beams[i - 1].range_m > 1.0F && scan.beams[i].state == BeamState::kHit) edge = i;
  }
  ASSERT_GT(edge, 0U);
  const auto count = [&] {
    return extract_polylines(segment(project_horizontally(scan, Eigen::Isometry3d::Identity()), {}), {}).hits.size();
  };
  const std::size_t all = count();
  scan.beams[edge].range_m = 2.9F;
  EXPECT_EQ(count(), all - 1U);
}

TEST(PolylineExtraction, AStepToASurfaceBehindEndsAPolyline) {
  LevelScene scene;  // a box 15 cm before a wall: segments join them
  scene.walls.push_back({{1.85, -0.5}, {1.85, 0.2}});
  scene.walls.push_back({{2.0, -2.0}, {2.0, 2.0}});
  const Polylines polylines = polylines_of(scene);
  ASSERT_EQ(polylines.polylines.size(), 3U);
  EXPECT_EQ(polylines.polylines[0].left_end, SegmentEnd::kOccluded);
  EXPECT_EQ(polylines.polylines[1].right_end, SegmentEnd::kBackground);
  EXPECT_EQ(polylines.polylines[1].left_end, SegmentEnd::kBackground);
  EXPECT_EQ(polylines.polylines[2].right_end, SegmentEnd::kOccluded);
  EXPECT_EQ(polylines.vertices.size(), 6U);
}

TEST(PolylineExtraction, HitsTooFewForALineHaveNoNormal) {
  LevelScene scene;
  scene.ellipses.push_back({{6.0, 0.0}, 0.0, 0.02, 0.02});
  Random random(3);
  const Polylines polylines = polylines_of(scene, &random);
  ASSERT_GE(polylines.hits.size(), 1U);
  for (const PolylineHit& hit : polylines.hits) {
    EXPECT_FALSE(hit.has_normal);
    EXPECT_NEAR(hit.normal_level.dot(hit.p_level_m.normalized()), -1.0, 1e-9);
  }
}

TEST(PolylineExtraction, NamesFieldAndBound) {
  PolylineParams params;
  params.max_offset_m = 0.0;
  EXPECT_TRUE(names(refusal_of([&] { params.validate(); }), {"polylines.max_offset_m"}));
}

}  // namespace
}  // namespace situation_awareness::polyline_extraction_test
