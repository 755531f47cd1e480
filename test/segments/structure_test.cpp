// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/segments/structure.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/level_scene.hpp"
#include "support/segment_scan.hpp"

namespace situation_awareness::structure_test {
namespace {

TEST(Structure, PiecesOfAWallBehindPostsAreStructure) {
  Random random(2);
  LevelScene scene;
  scene.walls = {{{6.0, -8.0}, {6.0, 8.0}}};
  for (int i = -3; i <= 3; ++i) scene.ellipses.push_back({{2.5, 0.5 * i}, 0.0, 0.1, 0.1});
  const Segments segments = segment_scan(scene.scan(&random));
  int objects = 0;
  int pieces = 0;
  for (const Segment& s : segments.segments) {
    const double x_m = segments.points[s.first + s.count / 2].p_level_m.x();
    if (x_m > 4.0) {
      EXPECT_EQ(s.kind, SegmentKind::kStructure);
      EXPECT_NE(s.structure, StructureReason::kNone);
      ++pieces;
    } else {
      EXPECT_EQ(s.kind, SegmentKind::kObject);
      ++objects;
    }
  }
  EXPECT_EQ(objects, 7);
  EXPECT_EQ(pieces, 8);
}

// A face of a box that a post hides in part is no wall: a beam beyond the post passes through its line. A piece of a
// wall as long ends in a corner, where none does.
TEST(Structure, AFaceThatEndsBehindAnOccluderIsAnObjectAndAPieceOfAWallIsNot) {
  Random random(3);
  SegmentationParams params;
  params.free_faces = true;
  const Ellipse post{{2.0, 0.5}, 0.0, 0.12, 0.12};  // before y = 0.85 to 1.2 m of what is at 4 m
  const auto seen_at_4_m = [&](const LevelScene& scene) {
    const Segments segments = segment_scan(scene.scan(&random, 0.004), params);
    for (const Segment& s : segments.segments) {
      const Eigen::Vector2d p_m = segments.points[s.first + s.count / 2].p_level_m;
      if (std::abs(p_m.x() - 4.0) < 0.1 && p_m.y() > 0.0 && p_m.y() < 0.9) return s.kind;
    }
    ADD_FAILURE() << "nothing is seen at 4 m";
    return SegmentKind::kObject;
  };
  for (int i = 0; i < 20; ++i) {
    LevelScene box;
    box.ellipses = {post};
    box.walls = {
        {{4.0, 0.1}, {4.0, 1.1}}, {{4.0, 1.1}, {5.0, 1.1}}, {{4.0, 0.1}, {5.0, 0.1}}, {{8.0, 1.0}, {8.0, 9.0}}};
    EXPECT_EQ(seen_at_4_m(box), SegmentKind::kObject) << i;
    LevelScene corner;
    corner.ellipses = {post};
    corner.walls = {{{4.0, 0.1}, {4.0, 1.1}}, {{4.0, 1.1}, {0.5, 1.1}}, {{8.0, 1.0}, {8.0, 9.0}}};
    EXPECT_EQ(seen_at_4_m(corner), SegmentKind::kStructure) << i;
  }
}

// A board of which one end is outside of the scan or behind a post is an object once something is seen behind its other
// end. A piece of a wall that is seen past posts has no such end, however long.
TEST(Structure, AFaceThatEndsBeforeABackgroundIsAnObject) {
  Random random(4);
  SegmentationParams params;
  params.free_faces = true;
  const auto kind_at = [&](const LevelScene& scene, const Eigen::Vector2d& p_m) {
    const Segments segments = segment_scan(scene.scan(&random, 0.004), params);
    for (const Segment& s : segments.segments) {
      for (std::size_t i = s.first; i < s.first + s.count; ++i) {
        if ((segments.points[i].p_level_m - p_m).norm() < 0.05) return s.kind;
      }
    }
    ADD_FAILURE() << "nothing is seen at " << p_m.transpose();
    return SegmentKind::kObject;
  };
  const auto edge_at = [](double range_m) -> Eigen::Vector2d {  // the last beam of 270 degrees
    return range_m * Eigen::Vector2d(std::cos(radians(135.0)), std::sin(radians(135.0)));
  };
  const Eigen::Vector2d board_end_m = edge_at(2.0) + Eigen::Vector2d(0.7, 0.0);
  const LevelScene::Wall board{edge_at(2.0) - Eigen::Vector2d(0.5, 0.0), board_end_m};
  const LevelScene::Wall background{{-9.0, 5.0}, {9.0, 5.0}};
  for (int i = 0; i < 20; ++i) {
    LevelScene scene;
    scene.walls = {board, background};
    EXPECT_EQ(kind_at(scene, edge_at(2.0) + Eigen::Vector2d(0.35, 0.0)), SegmentKind::kObject) << i;
    scene.walls = {{{4.0, -0.5}, {4.0, 0.6}}, background, {{8.0, -9.0}, {8.0, 9.0}}};
    scene.ellipses = {{{2.0, -0.2}, 0.0, 0.12, 0.12}};
    EXPECT_EQ(kind_at(scene, {4.0, 0.3}), SegmentKind::kObject) << i;
    scene.walls = {{{4.0, -9.0}, {4.0, 9.0}}};
    scene.ellipses.push_back({{2.0, 0.4}, 0.0, 0.12, 0.12});
    EXPECT_EQ(kind_at(scene, {4.0, 0.2}), SegmentKind::kStructure) << i;
  }
}

// Through a gap between two occluders a wall shows no bend but that of the range noise, and a post does.
TEST(Structure, WhatIsSeenThroughAGapIsAnObjectIfItsBendExceedsTheNoise) {
  Random random(4);
  const auto seen_beyond = [&random](const LevelScene& scene) {
    const Segments segments = segment_scan(scene.scan(&random));
    for (const Segment& s : segments.segments) {
      if (segments.points[s.first + s.count / 2].p_level_m.x() > 4.0) return s;
    }
    ADD_FAILURE() << "nothing is seen through the gap";
    return Segment{};
  };
  LevelScene occluders;
  occluders.walls = {{{2.0, -3.0}, {2.0, -0.07}}, {{2.0, 0.07}, {2.0, 3.0}}};
  int objects = 0;
  for (int i = 0; i < 200; ++i) {
    LevelScene with_wall = occluders;
    with_wall.walls.push_back({{6.0, -8.0}, {6.0, 8.0}});
    const Segment piece = seen_beyond(with_wall);
    EXPECT_FALSE(is_silhouette(piece.right_end) || is_silhouette(piece.left_end));
    objects += piece.kind == SegmentKind::kObject ? 1 : 0;
    LevelScene with_post = occluders;
    with_post.ellipses = {{{6.0, 0.0}, 0.0, 0.25, 0.25}};
    EXPECT_EQ(seen_beyond(with_post).kind, SegmentKind::kObject) << i;
  }
  EXPECT_LE(objects, 4);
}

// Ellipses up to 1 : 4 bulge at any orientation; a cabinet's front does not, even if it is not quite straight. With
// free faces a front of which both edges are seen is an object.
TEST(Structure, FlatFrontsAreStructureAndFlatEllipsesAreNot) {
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    const double turn_rad = random.uniform(-0.6, 0.6);
    const Eigen::Vector2d along(-std::sin(turn_rad), std::cos(turn_rad));
    const Eigen::Vector2d middle(random.uniform(1.5, 4.0), random.uniform(-0.5, 0.5));
    const double half_m = random.uniform(0.25, 0.5);
    const double step_m = random.uniform(0.0, 0.02);
    LevelScene front;
    const Eigen::Vector2d step(step_m, 0.0);
    front.walls = {{middle - half_m * along, middle}, {middle + step, middle + step + half_m * along}};
    const Scan scan = front.scan(&random);
    for (const bool free_faces : {false, true}) {
      SegmentationParams params;
      params.free_faces = free_faces;
      const Segments flat = segment_scan(scan, params);
      ASSERT_EQ(flat.segments.size(), 1U);
      EXPECT_EQ(flat.segments[0].structure, free_faces ? StructureReason::kNone : StructureReason::kFlat)
          << "front " << i;
    }

    LevelScene body;
    const double rx_m = random.uniform(0.1, 0.5);
    body.ellipses = {{middle, random.uniform(-kPi / 2.0, kPi / 2.0), rx_m, rx_m / random.uniform(1.0, 4.0)}};
    const Segments round = segment_scan(body.scan(&random));
    ASSERT_EQ(round.segments.size(), 1U);
    EXPECT_EQ(round.segments[0].kind, SegmentKind::kObject) << "ellipse " << i;
  }
}

// With its own edge on both sides a narrow board is an object; occluded by a post it may be part of a wall, and a
// curved segment with such an occlusion is still an object.
TEST(Structure, AStraightPieceWithAHiddenEndIsStructure) {
  LevelScene scene;
  const auto reason_of_far = [&] {
    const Segments segments = segment_scan(scene.scan());
    for (const Segment& s : segments.segments) {
      if (segments.points[s.first].p_level_m.x() > 2.0) return s.structure;
    }
    ADD_FAILURE() << "not seen";
    return StructureReason::kNone;
  };
  scene.walls = {{{4.0, -0.14}, {4.0, 0.14}}};
  EXPECT_EQ(reason_of_far(), StructureReason::kNone);
  scene.ellipses = {{{1.5, 0.08}, 0.0, 0.06, 0.06}};
  EXPECT_EQ(reason_of_far(), StructureReason::kStraightHidden);
  scene.walls.clear();
  scene.ellipses.push_back({{4.0, 0.0}, 0.0, 0.4, 0.4});
  EXPECT_EQ(reason_of_far(), StructureReason::kNone);
}

TEST(Structure, AnInnerCornerIsStructureAndAnObjectOfTheSameSizeIsNot) {
  LevelScene scene;
  scene.walls = {{{4.0, 0.0}, {3.6, 0.4}}, {{4.0, 0.0}, {3.6, -0.4}}};
  Segments segments = segment_scan(scene.scan());
  ASSERT_EQ(segments.segments.size(), 1U);
  EXPECT_EQ(segments.segments[0].structure, StructureReason::kInnerCorner);
  scene.walls.clear();
  scene.ellipses = {{{3.8, 0.0}, 0.0, 0.4, 0.4}};
  segments = segment_scan(scene.scan());
  ASSERT_EQ(segments.segments.size(), 1U);
  EXPECT_EQ(segments.segments[0].structure, StructureReason::kNone);
}

// Two boards that meet, seen from inside, with something behind: no corner of a room looks like that.
TEST(Structure, AnInnerCornerBeforeABackgroundIsAnObject) {
  SegmentationParams params;
  LevelScene scene;
  scene.walls = {{{4.0, 0.0}, {3.6, 0.4}}, {{4.0, 0.0}, {3.6, -0.4}}, {{8.0, -8.0}, {8.0, 8.0}}};
  const auto kind_of_corner = [&] {
    const Segments segments = segment_scan(scene.scan(), params);
    for (const Segment& s : segments.segments) {
      if (segments.points[s.first + s.count / 2].p_level_m.x() < 5.0) return s.kind;
    }
    ADD_FAILURE() << "the corner is not seen";
    return SegmentKind::kObject;
  };
  for (const bool free_faces : {false, true}) {
    params.free_faces = free_faces;
    EXPECT_EQ(kind_of_corner(), free_faces ? SegmentKind::kObject : SegmentKind::kStructure);
  }
  scene.walls.push_back({{3.6, 0.4}, {3.0, 8.0}});  // the left board goes on
  EXPECT_EQ(kind_of_corner(), SegmentKind::kStructure);
}

/// Walls with a passage, posts before them, a cabinet, a board behind a post, an inner corner, and objects.
LevelScene furnished_scene(Random& random) {
  LevelScene scene;
  scene.walls = {{{6.0, -8.0}, {6.0, 1.0}},
                 {{6.0, 2.5}, {6.0, 8.0}},
                 {{3.0, 4.0}, {3.5, 3.6}},
                 {{-1.0, 3.6}, {-0.6, 4.0}},
                 {{-0.6, 4.0}, {-0.2, 3.6}}};
  for (int i = 0; i < 6; ++i) {
    const double azimuth_rad = random.uniform(-2.0, 2.0);
    const double distance_m = random.uniform(1.5, 4.0);
    const double rx_m = random.uniform(0.05, 0.4);
    scene.ellipses.push_back({{distance_m * std::cos(azimuth_rad), distance_m * std::sin(azimuth_rad)},
                              random.uniform(-kPi / 2.0, kPi / 2.0),
                              rx_m,
                              rx_m / random.uniform(1.0, 3.0)});
  }
  return scene;
}

TEST(Structure, EachSegmentHasAReasonOrMayBeAnObject) {
  Random random(7);
  Counters reasons;
  for (int i = 0; i < 100; ++i) {
    const LevelScene scene = furnished_scene(random);
    const Segments segments = segment_scan(scene.scan(&random));
    for (const Segment& s : segments.segments) {
      EXPECT_EQ(s.kind == SegmentKind::kStructure, s.structure != StructureReason::kNone);
      // Segments in line with another are not structure by themselves; all others have their own reason.
      const StructureReason alone = structure_reason(segments, s, {});
      EXPECT_EQ(alone, s.structure == StructureReason::kInLine ? StructureReason::kNone : s.structure);
    }
    for (const auto& [reason, count] : segments.refused) reasons[reason] += count;
  }
  for (const char* reason :
       {"structure: larger than an object", "structure: inner corner", "structure: straight, an end hidden",
        "structure: flat", "structure: in line with another"}) {
    EXPECT_GT(reasons.of(reason), 0U) << reason;
  }
}

TEST(Structure, EarlierClassificationsHaveNoEffect) {
  Random random(8);
  for (int i = 0; i < 50; ++i) {
    const Segments once = segment_scan(furnished_scene(random).scan(&random));
    Segments other = once;
    other.refused.reset();
    for (Segment& s : other.segments) {
      s.kind = SegmentKind::kStructure;
      s.structure = StructureReason::kExtent;
    }
    other = classify_structure(std::move(other), {});
    ASSERT_EQ(other.segments.size(), once.segments.size());
    for (std::size_t k = 0; k < once.segments.size(); ++k) {
      EXPECT_EQ(other.segments[k].kind, once.segments[k].kind);
      EXPECT_EQ(other.segments[k].structure, once.segments[k].structure);
    }
  }
}

// The classification is invariant under rotation of world and scanner together.
TEST(Structure, IsInvariantUnderRotation) {
  Random random(9);
  for (int i = 0; i < 50; ++i) {
    const Segments segments = segment_scan(furnished_scene(random).scan(&random));
    const Pose2 turn{Eigen::Vector2d::Zero(), random.uniform(-kPi, kPi)};
    Segments turned = segments;
    turned.refused.reset();
    for (Point& point : turned.points) {
      point.p_level_m = turn * point.p_level_m;
      point.azimuth_rad += turn.yaw_rad;
    }
    turned = classify_structure(std::move(turned), {});
    EXPECT_EQ(turned.refused.of("structure: flat"), segments.refused.of("structure: flat"));
    for (std::size_t k = 0; k < segments.segments.size(); ++k) {
      EXPECT_EQ(turned.segments[k].structure, segments.segments[k].structure);
    }
  }
}

}  // namespace
}  // namespace situation_awareness::structure_test
