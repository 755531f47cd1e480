// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/segments/segmentation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "support/level_scene.hpp"
#include "support/refusal.hpp"
#include "support/segment_scan.hpp"

namespace situation_awareness::segmentation_test {
namespace {

std::set<int> beams_of(const Segments& segments, const Segment& segment) {
  std::set<int> beams;
  for (std::size_t i = 0; i < segment.count; ++i) beams.insert(segments.points[segment.first + i].beam);
  return beams;
}

TEST(Segmentation, FindsEachEllipseWithExactlyItsBeams) {
  Random random(1);
  LevelScene scene;
  scene.ellipses = {{{3.0, 0.0}, 0.3, 0.4, 0.2}, {{2.0, 2.0}, 1.0, 0.2, 0.1}, {{5.0, -4.0}, 0.0, 0.5, 0.3}};
  const Scan scan = scene.scan(&random);
  const Segments segments = segment_scan(scan);
  ASSERT_EQ(segments.segments.size(), 3U);
  std::size_t hits = 0;
  for (const Beam& beam : scan.beams) hits += beam.state == BeamState::kHit ? 1U : 0U;
  std::set<int> all;
  for (const Segment& s : segments.segments) {
    EXPECT_EQ(s.kind, SegmentKind::kObject);
    EXPECT_EQ(s.right_end, SegmentEnd::kFree);
    EXPECT_EQ(s.left_end, SegmentEnd::kFree);
    all.merge(beams_of(segments, s));
  }
  EXPECT_EQ(all.size(), hits);
}

// Hits in no segment are kept with the reason.
TEST(Segmentation, EveryHitIsInOneSegmentOrOneRefusedRun) {
  Random random(4);
  std::uint64_t too_few = 0, outside = 0;
  for (int i = 0; i < 50; ++i) {
    LevelScene scene;
    scene.beams = 720;
    scene.angle_increment_rad = radians(0.5);
    scene.angle_min_rad = -kPi;
    scene.walls = {{{6.0, -8.0}, {6.0, 8.0}}, {{6.0, 8.0}, {-3.0, 8.0}}};
    for (int k = 0; k < 8; ++k) {
      const double radius_m = random.uniform(0.01, 0.4);
      scene.ellipses.push_back({{random.uniform(-5.0, 5.0), random.uniform(1.0, 5.0)}, 0.0, radius_m, radius_m});
    }
    Scan scan = scene.scan(&random);
    const auto first = static_cast<std::size_t>(random.uniform(0.0, 400.0));
    for (std::size_t k = first; k < first + 200; ++k) {
      if (scan.beams[k].state == BeamState::kHit) scan.beams[k].state = BeamState::kOutside;
    }
    const Segments segments = segment_scan(scan);
    std::multiset<int> beams;
    for (const Segment& s : segments.segments) {
      for (std::size_t k = s.first; k < s.first + s.count; ++k) beams.insert(segments.points[k].beam);
    }
    for (const RefusedRun& run : segments.refused_runs) {
      ASSERT_GT(run.count, 0U);
      for (std::size_t k = run.first; k < run.first + run.count; ++k) beams.insert(segments.points[k].beam);
      ++(run.why == RunRefusal::kOutside ? outside : too_few);
    }
    std::multiset<int> hits;
    for (std::size_t k = 0; k < scan.beams.size(); ++k) {
      if (is_hit(scan.beams[k].state)) hits.insert(static_cast<int>(k));
    }
    EXPECT_EQ(beams, hits);
    EXPECT_EQ(segments.points.size(), hits.size());
  }
  EXPECT_GT(too_few, 10U);
  EXPECT_GT(outside, 10U);
}

TEST(Segmentation, KeepsIntensities) {
  LevelScene scene;
  scene.ellipses = {{{3.0, 0.0}, 0.3, 0.4, 0.2}, {{2.0, 2.0}, 1.0, 0.2, 0.1}};
  Scan scan = scene.scan();
  for (std::size_t i = 0; i < scan.beams.size(); ++i) scan.beams[i].intensity = static_cast<float>(i);
  const Segments segments = segment_scan(scan);
  ASSERT_EQ(segments.segments.size(), 2U);
  for (const Point& point : segments.points) EXPECT_EQ(point.intensity, static_cast<float>(point.beam));
}

TEST(Segmentation, ClassifiesTheEndsOfSegments) {
  LevelScene scene;
  scene.ellipses = {{{2.0, 0.0}, 0.0, 0.2, 0.2}, {{4.0, 0.5}, 0.0, 0.4, 0.4}};
  scene.walls = {{{8.0, -20.0}, {8.0, 3.0}}};
  // A post stands at the last beam, half out of view.
  const double edge_rad = radians(135.0);
  scene.ellipses.push_back({{3.0 * std::cos(edge_rad), 3.0 * std::sin(edge_rad)}, 0.0, 0.2, 0.2});
  const Segments segments = segment_scan(scene.scan());
  ASSERT_EQ(segments.segments.size(), 5U);
  const Segment& wall_right = segments.segments[0];
  const Segment& near = segments.segments[1];
  const Segment& far = segments.segments[2];
  const Segment& wall_left = segments.segments[3];
  const Segment& last = segments.segments[4];
  EXPECT_EQ(wall_right.kind, SegmentKind::kStructure);
  EXPECT_EQ(wall_right.left_end, SegmentEnd::kOccluded);
  EXPECT_EQ(near.right_end, SegmentEnd::kBackground);
  EXPECT_EQ(near.left_end, SegmentEnd::kBackground);
  EXPECT_EQ(far.right_end, SegmentEnd::kOccluded);
  EXPECT_EQ(far.left_end, SegmentEnd::kBackground);
  EXPECT_EQ(wall_left.kind, SegmentKind::kStructure);
  EXPECT_EQ(wall_left.right_end, SegmentEnd::kOccluded);
  EXPECT_EQ(wall_left.left_end, SegmentEnd::kFree);
  EXPECT_EQ(last.right_end, SegmentEnd::kFree);
  EXPECT_EQ(last.left_end, SegmentEnd::kScanEdge);

  // Behind the near ellipse nothing is visible; beside it, the wall shows that the far one has ended.
  const SegmentationParams params;
  EXPECT_NEAR(far.right_hidden_rad, static_cast<double>(near.count) * segments.resolution_rad, 1e-9);
  EXPECT_EQ(far.left_hidden_rad, 0.0);
  EXPECT_EQ(near.right_hidden_rad, 0.0);
  EXPECT_NEAR(last.left_hidden_rad, 2.0 * params.max_object_extent_m / 2.8, 0.05);  // as far as an object could reach
}

TEST(Segmentation, SkipsInvalidBeamsAndEndsAtTooCloseOnes) {
  LevelScene scene;
  scene.ellipses = {{{3.0, 0.0}, 0.0, 0.3, 0.3}};
  Scan scan = scene.scan();
  std::size_t first = 0;
  while (scan.beams[first].state != BeamState::kHit) ++first;
  std::size_t last = scan.beams.size() - 1;
  while (scan.beams[last].state != BeamState::kHit) --last;
  scan.beams[first - 1] = {0.0F, BeamState::kTooClose};
  scan.beams[last + 1] = {0.0F, BeamState::kInvalid};
  scan.beams[(first + last) / 2] = {0.0F, BeamState::kInvalid};
  const Segments segments = segment_scan(scan);
  ASSERT_EQ(segments.segments.size(), 1U);
  EXPECT_EQ(segments.segments[0].count, last - first);
  EXPECT_EQ(segments.segments[0].right_end, SegmentEnd::kOccluded);
  EXPECT_EQ(segments.segments[0].left_end, SegmentEnd::kFree);
}

// A beam without a return has no information beyond range_max.
TEST(Segmentation, SegmentsAtRangeMaxHaveHiddenEnds) {
  LevelScene scene;
  scene.ellipses = {{{3.1, 0.0}, 0.0, 0.4, 0.4}};
  const Segments whole = segment_scan(scene.scan());
  ASSERT_EQ(whole.segments.size(), 1U);
  scene.max_range_m = 2.8;
  const Segments cut = segment_scan(scene.scan());
  ASSERT_EQ(cut.segments.size(), 1U);
  const Segment& segment = cut.segments[0];
  EXPECT_LT(segment.count, whole.segments[0].count);
  EXPECT_EQ(segment.right_end, SegmentEnd::kOccluded);
  EXPECT_EQ(segment.left_end, SegmentEnd::kOccluded);
  EXPECT_GT(segment.right_hidden_rad, 0.1);
  EXPECT_GT(segment.left_hidden_rad, 0.1);
  scene.max_range_m = 3.2;  // beyond its ends
  const Segments reached = segment_scan(scene.scan());
  ASSERT_EQ(reached.segments.size(), 1U);
  EXPECT_EQ(reached.segments[0].count, whole.segments[0].count);
  EXPECT_EQ(reached.segments[0].right_end, SegmentEnd::kFree);
  EXPECT_EQ(reached.segments[0].left_end, SegmentEnd::kFree);
}

TEST(Segmentation, DropsTooFewPoints) {
  LevelScene scene;
  scene.ellipses = {{{9.0, 0.0}, 0.0, 0.05, 0.05}};
  EXPECT_TRUE(segment_scan(scene.scan()).segments.empty());
  SegmentationParams params;
  params.min_points = 2;
  params.min_points_fraction = 0.0;
  EXPECT_EQ(segment_scan(scene.scan(), params).segments.size(), 1U);
}

// Three hits on a leg are a segment if what is behind it is seen on both sides; beside a nearer thing, or beside beams
// without a return, they are not.
TEST(Segmentation, ThreeHitsOnANarrowThingBeforeABackgroundAreASegment) {
  SegmentationParams params;
  params.min_points_fraction = 0.0;
  const LevelScene::Wall background{{9.0, -9.0}, {9.0, 9.0}};
  const auto counts_within = [&](const LevelScene& scene, double range_m) {
    std::vector<std::size_t> counts;
    const Segments segments = segment_scan(scene.scan(), params);
    for (const Segment& s : segments.segments) {
      if (segments.points[s.first].range_m < range_m) counts.push_back(s.count);
    }
    return counts;
  };
  LevelScene leg;
  leg.ellipses = {{{8.0, 0.0}, 0.0, 0.05, 0.05}};
  leg.walls = {background};
  params.min_narrow_points = 2;
  const std::vector<std::size_t> counts = counts_within(leg, 8.5);
  ASSERT_EQ(counts.size(), 1U);
  ASSERT_LT(counts[0], static_cast<std::size_t>(params.min_points));
  params.min_narrow_points = static_cast<int>(counts[0]);
  EXPECT_EQ(counts_within(leg, 8.5), counts);
  params.min_narrow_points = static_cast<int>(counts[0]) + 1;
  EXPECT_TRUE(counts_within(leg, 8.5).empty());

  params.min_narrow_points = 2;
  LevelScene alone = leg;
  alone.walls.clear();
  EXPECT_TRUE(counts_within(alone, 8.5).empty());
  LevelScene beside = leg;
  beside.walls.push_back({{6.0, 0.02}, {6.0, 2.0}});
  EXPECT_EQ(counts_within(beside, 8.5).size(), 1U) << "the nearer thing alone";
}

// The same scene seen by a scanner that turns anywhere, over the seam too, gives the same segments.
TEST(Segmentation, FullCircleHasNoSeam) {
  for (const double increment_deg : {0.5, -0.5}) {
    for (int turn = 0; turn < 24; ++turn) {
      const double yaw_rad = radians(15.0 * turn);
      LevelScene scene;
      scene.beams = 720;
      scene.angle_increment_rad = radians(increment_deg);
      scene.angle_min_rad = increment_deg > 0 ? -kPi : kPi;
      for (const Eigen::Vector2d& center : {Eigen::Vector2d(2.0, 0.0), Eigen::Vector2d(-1.0, 2.0)}) {
        scene.ellipses.push_back(Pose2{Eigen::Vector2d::Zero(), -yaw_rad} * Ellipse{center, 0.4, 0.3, 0.2});
      }
      const Segments segments = segment_scan(scene.scan(), {}, yaw_rad);
      ASSERT_EQ(segments.segments.size(), 2U) << "turn " << turn;
      for (const Segment& s : segments.segments) {
        EXPECT_EQ(s.kind, SegmentKind::kObject);
        EXPECT_EQ(s.left_end, SegmentEnd::kFree);
        EXPECT_EQ(s.right_end, SegmentEnd::kFree);
        for (std::size_t i = 1; i < s.count; ++i) {
          const double step = segments.points[s.first + i].azimuth_rad - segments.points[s.first + i - 1].azimuth_rad;
          EXPECT_NEAR(step, radians(0.5), 1e-6);
        }
      }
    }
  }
}

TEST(Segmentation, AClosedRoomAroundAFullCircleScannerIsOneStructure) {
  LevelScene scene;
  scene.beams = 720;
  scene.angle_increment_rad = radians(0.5);
  scene.angle_min_rad = -kPi;
  scene.walls = {{{4, -3}, {4, 3}}, {{4, 3}, {-4, 3}}, {{-4, 3}, {-4, -3}}, {{-4, -3}, {4, -3}}};
  const Segments segments = segment_scan(scene.scan());
  ASSERT_EQ(segments.segments.size(), 1U);
  EXPECT_EQ(segments.segments[0].count, 720U);
  EXPECT_EQ(segments.segments[0].kind, SegmentKind::kStructure);
}

TEST(Segmentation, AnObjectOnTheBorderOfTheVolumeStaysWholeAndOneOutsideIsDropped) {
  LevelScene scene;
  scene.ellipses = {{{3.0, 0.0}, 0.0, 0.3, 0.3}, {{0.0, 3.0}, 0.0, 0.3, 0.3}};
  Scan scan = scene.scan();
  const auto index = [](double azimuth_deg) { return static_cast<std::size_t>((azimuth_deg + 135.0) * 4.0); };
  for (std::size_t i = 0; i < index(-2.0); ++i) {
    if (scan.beams[i].state == BeamState::kHit) scan.beams[i].state = BeamState::kOutside;
  }
  for (std::size_t i = index(45.0); i < scan.beams.size(); ++i) {
    if (scan.beams[i].state == BeamState::kHit) scan.beams[i].state = BeamState::kOutside;
  }
  const Segments segments = segment_scan(scan);
  ASSERT_EQ(segments.segments.size(), 1U);
  EXPECT_GT(segments.points[segments.segments[0].first].p_level_m.x(), 2.0);
  // All beams that see it, inside the volume or not: 2 asin(0.3 / 3) wide.
  EXPECT_NEAR(static_cast<double>(segments.segments[0].count), degrees(2.0 * std::asin(0.1)) * 4.0, 1.01);
}

// Every structure and every dropped run of hits has its reason.
TEST(Segmentation, CountsRefusedSegmentsByReason) {
  Random random(2);
  for (int seed = 0; seed < 20; ++seed) {
    LevelScene scene;
    scene.walls = {{{6.0, -8.0}, {6.0, 8.0}}, {{6.0, 8.0}, {-3.0, 8.0}}};
    scene.ellipses = {{{3.0, random.uniform(-2.0, 2.0)}, 0.3, 0.4, 0.2},
                      {{2.0, random.uniform(-2.0, 2.0)}, 1.0, 0.2, 0.1},
                      {{5.0, random.uniform(-4.0, 4.0)}, 0.0, 0.02, 0.02}};
    const Segments segments = segment_scan(scene.scan(&random));
    std::uint64_t structures = 0;
    for (const Segment& s : segments.segments) structures += s.kind == SegmentKind::kStructure ? 1U : 0U;
    std::uint64_t counted = 0;
    for (const auto& [reason, count] : segments.refused) counted += reason.find("structure: ") == 0 ? count : 0U;
    EXPECT_EQ(structures, counted);
    EXPECT_GT(segments.refused.of("structure: larger than an object"), 0U);
  }
  SegmentationParams params;
  LevelScene scene;
  scene.ellipses = {{{3.0, 0.0}, 0.3, 0.4, 0.2}};
  EXPECT_EQ(segment_scan(scene.scan(), params).refused, Counters{});
  params.min_points = 1000;
  EXPECT_EQ(segment_scan(scene.scan(), params).refused, (Counters{{"segment refused: too few points", 1}}));
}

TEST(SegmentationParams, RefusesWrongValuesByName) {
  SegmentationParams params;
  params.max_missing_beams = -1;
  EXPECT_TRUE(names(refusal_of([&] { params.validate(); }), {"segments.max_missing_beams", "-1"}));
}

TEST(Segmentation, EmptyAndSilentScansHaveNoSegments) {
  EXPECT_TRUE(segment(Points{}, {}).segments.empty());
  LevelScene scene;
  EXPECT_TRUE(segment_scan(scene.scan()).segments.empty());
  scene.beams = 360;
  scene.angle_min_rad = -kPi;
  scene.angle_increment_rad = radians(1.0);
  EXPECT_TRUE(segment_scan(scene.scan()).segments.empty());
}

/// A wall of 2 m behind a thing of 0.3 m, of which the scanner loses every `lost`-th beam.
Segments lossy(int lost, bool wall) {
  LevelScene scene;
  scene.walls = {{{2.0, -0.15}, {2.0, 0.15}}};
  if (wall) scene.walls.push_back({{4.0, -4.0}, {4.0, 4.0}});
  Scan scan = scene.scan();
  for (std::size_t i = 0; i < scan.beams.size(); i += static_cast<std::size_t>(lost)) {
    scan.beams[i] = {static_cast<float>(scene.max_range_m), BeamState::kFree};
  }
  return segment(project_horizontally(scan, Eigen::Isometry3d::Identity()), {});
}

const Segment& nearest(const Segments& segments) {
  return *std::min_element(segments.segments.begin(), segments.segments.end(), [&](const Segment& a, const Segment& b) {
    return segments.points[a.first].range_m < segments.points[b.first].range_m;
  });
}

// Where surfaces lose returns, a beam without one beside a thing is no proof of free space.
TEST(Segmentation, FreeEndsAreNoSilhouettesInScansThatLoseReturns) {
  const Segments reliable = lossy(1000, false);
  EXPECT_EQ(nearest(reliable).right_end, SegmentEnd::kFree);
  EXPECT_EQ(nearest(reliable).right_hidden_rad, 0.0);
  const Segments alone = lossy(7, false);
  ASSERT_EQ(alone.segments.size(), 1U);
  EXPECT_EQ(alone.segments[0].right_end, SegmentEnd::kNoReturn);
  EXPECT_EQ(alone.segments[0].left_end, SegmentEnd::kNoReturn);
  EXPECT_GT(alone.segments[0].left_hidden_rad, 0.5) << "no return tells where it ends";
}

// Scanners that lose returns lose most at edges. The wall beside an edge is hidden by what is nearer all the same.
TEST(Segmentation, WhatIsBehindALostEdgeIsOccluded) {
  LevelScene scene;
  scene.walls = {{{2.0, -0.15}, {2.0, 0.15}}, {{4.0, -4.0}, {4.0, 4.0}}};
  const auto ends_behind = [&](std::size_t lost_at_edges) {
    Scan scan = scene.scan();
    const std::vector<Beam> whole = scan.beams;
    for (std::size_t i = 10; i + 10 < whole.size(); ++i) {
      const auto near_within = [&](std::size_t beams) {
        return whole[i - beams].range_m < 3.0F || whole[i + beams].range_m < 3.0F;
      };
      const bool lost = near_within(0) ? false : near_within(10) ? near_within(lost_at_edges) : i % 7 == 0;
      if (lost) scan.beams[i] = {static_cast<float>(scene.max_range_m), BeamState::kFree};
    }
    const Segments found = segment(project_horizontally(scan, Eigen::Isometry3d::Identity()), {});
    const Segment& thing = nearest(found);
    EXPECT_EQ(thing.right_end, SegmentEnd::kNoReturn);
    EXPECT_EQ(thing.left_end, SegmentEnd::kNoReturn);
    const Segment* const right = &thing - 1;
    const Segment* const left = &thing + 1;
    return std::array<SegmentEnd, 2>{right->left_end, left->right_end};
  };
  const auto max_missing = static_cast<std::size_t>(SegmentationParams{}.max_missing_beams);
  for (const SegmentEnd end : ends_behind(1)) EXPECT_EQ(end, SegmentEnd::kOccluded);
  for (const SegmentEnd end : ends_behind(max_missing)) EXPECT_EQ(end, SegmentEnd::kOccluded);
  for (const SegmentEnd end : ends_behind(max_missing + 3)) EXPECT_EQ(end, SegmentEnd::kNoReturn) << "open space";
}

// In a room nearly all beams return. Those that do not beside a near thing were lost on its side, which they graze: it
// hides what is behind. Outdoors they pass freely, and so they do in a room through what is as wide as a door.
TEST(Segmentation, InARoomBeamsWithoutAReturnBesideANearThingWereLostOnItsSide) {
  LevelScene room;
  room.walls = {{{4.0, -0.3}, {4.0, 0.3}},
                {{6.0, -6.0}, {6.0, 6.0}},
                {{-6.0, 6.0}, {6.0, 6.0}},
                {{-6.0, -6.0}, {6.0, -6.0}},
                {{-6.0, -6.0}, {-6.0, 6.0}}};
  LevelScene outdoors;
  outdoors.walls = {room.walls[0], room.walls[1]};
  const auto end_behind = [](const LevelScene& scene, int lost) {
    Scan scan = scene.scan();
    for (std::size_t i = 1; i + 1 < scan.beams.size(); ++i) {
      if (!(scan.beams[i - 1].range_m < 4.5F) || scan.beams[i].range_m < 4.5F) continue;
      for (int k = 0; k < lost; ++k) {
        scan.beams[i + static_cast<std::size_t>(k)] = {static_cast<float>(scene.max_range_m), BeamState::kFree};
      }
      break;
    }
    const Segments segments = segment(project_horizontally(scan, Eigen::Isometry3d::Identity()), {});
    const Segment& thing = nearest(segments);
    EXPECT_EQ(thing.left_end, SegmentEnd::kFree);
    return *(&thing + 1);
  };
  EXPECT_EQ(end_behind(room, 8).right_end, SegmentEnd::kOccluded);
  EXPECT_GT(end_behind(room, 8).right_hidden_rad, 0.1);
  EXPECT_EQ(end_behind(room, 40).right_end, SegmentEnd::kFree);
  EXPECT_EQ(end_behind(outdoors, 8).right_end, SegmentEnd::kFree);
  LevelScene legs = room;
  legs.walls[0] = {{4.0, -0.07}, {4.0, 0.07}};
  legs.walls.push_back({{4.8, 0.15}, {4.8, 0.29}});
  EXPECT_EQ(end_behind(legs, 3).right_end, SegmentEnd::kFree) << "a leg beside a leg";
}

/// A box of 1 m x 0.8 m, seen by its shorter face and at a grazing angle by its longer one, in a room.
LevelScene grazed_box(double psi_rad) {
  LevelScene scene;
  scene.angle_min_rad = radians(-90.0);
  scene.beams = 721;
  const auto add = [&](const Box& box) {
    const auto at = corners(box);
    for (std::size_t i = 0; i < at.size(); ++i) scene.walls.push_back({at[i], at[(i + 1) % at.size()]});
  };
  add({{3.2, 0.0}, psi_rad, 0.5, 0.4});
  add({{0.0, 0.0}, 0.0, 8.0, 8.0});
  return scene;
}

// Hits on a surface at a grazing angle are farther apart than max_gap_m. Where they lie on one line with the segment's
// end they belong to it.
TEST(Segmentation, ASurfaceGoesOnOverItsHitsAtAGrazingAngle) {
  int joined = 0;
  for (double psi_rad = 0.16; psi_rad < 0.24; psi_rad += 0.005) {
    const Scan scan = grazed_box(psi_rad).scan();
    std::set<int> on_box;
    for (std::size_t i = 0; i < scan.beams.size(); ++i) {
      if (scan.beams[i].range_m < 5.0F) on_box.insert(static_cast<int>(i));
    }
    const Segments segments = segment_scan(scan);
    const Segment& box = nearest(segments);
    joined += beams_of(segments, box) == on_box ? 1 : 0;
    std::set<std::size_t> in_runs;
    for (const RefusedRun& run : segments.refused_runs) {
      for (std::size_t k = run.first; k < run.first + run.count; ++k) {
        EXPECT_TRUE(in_runs.insert(k).second);
        EXPECT_TRUE(k < box.first || k >= box.first + box.count) << "in a segment and refused";
      }
    }
    EXPECT_EQ(segments.refused.of("segment refused: too few points"), segments.refused_runs.size());
  }
  EXPECT_GE(joined, 12) << "a single hit is on a line with any end";
}

TEST(Segmentation, HitsBehindAnEndThatAreNotOnOneLineWithItBelongToOtherThings) {
  LevelScene scene = grazed_box(0.0);
  const std::size_t count = nearest(segment_scan(scene.scan())).count;
  // Two thin things behind its left end, which is at (2.7, 0.4).
  scene.ellipses = {{{3.0, 0.46}, 0.0, 0.02, 0.02}, {{3.5, 0.72}, 0.0, 0.02, 0.02}};
  const Segments segments = segment_scan(scene.scan());
  EXPECT_GE(segments.refused_runs.size(), 1U);
  EXPECT_EQ(nearest(segments).count, count);
}

}  // namespace
}  // namespace situation_awareness::segmentation_test
