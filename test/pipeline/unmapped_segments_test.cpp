// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/unmapped_segments.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "support/level_scene.hpp"

namespace situation_awareness::unmapped_segments_test {
namespace {

const std::string kSource = SITUATION_AWARENESS_SOURCE_DIR;

/// A scan of its own: segments of hits 1 cm apart along y, given by their first hit in the level frame.
struct HandMade {
  Segments segments;

  explicit HandMade(double stamp_s, const Pose2& T_world_level = {}) {
    segments.stamp_ns = nanoseconds(stamp_s);
    segments.T_world_level = T_world_level;
  }

  HandMade& add(const Eigen::Vector2d& first_level_m, std::size_t hits, SegmentKind kind = SegmentKind::kObject) {
    Segment& segment = segments.segments.emplace_back();
    segment.first = segments.points.size();
    segment.count = hits;
    segment.kind = kind;
    for (std::size_t i = 0; i < hits; ++i) {
      segments.points.emplace_back().p_level_m = first_level_m + Eigen::Vector2d(0.0, 0.01 * static_cast<double>(i));
    }
    return *this;
  }
};

Objects map_of(const std::vector<Object>& objects) {
  Objects map;
  map.objects = objects;
  return map;
}

Object ellipse(std::uint64_t id, const Ellipse& ellipse_world) {
  Object object;
  object.id = id;
  object.ellipse_world = ellipse_world;
  return object;
}

Object box(std::uint64_t id, const Box& box_world) {
  Object object = ellipse(id, moment_equal_ellipse(box_world));
  object.shape = Shape::kBox;
  object.box_world = box_world;
  return object;
}

TEST(MappedAreas, AHitIsOnWhatItIsInsideOfOrNear) {
  MappedAreas areas;
  areas.set(map_of({ellipse(7, {{0.0, 0.0}, 0.0, 0.5, 0.2}), box(8, {{3.0, 0.0}, 0.5 * kPi, 0.5, 0.2})}));
  EXPECT_EQ(areas.object_at({0.0, 0.0}), 0U);
  EXPECT_EQ(areas.object_at({0.0, 0.34}), 0U);
  EXPECT_EQ(areas.object_at({0.0, -0.36}), MappedAreas::kNone);
  EXPECT_EQ(areas.object_at({-0.64, 0.0}), 0U);
  EXPECT_EQ(areas.object_at({-0.66, 0.0}), MappedAreas::kNone);
  EXPECT_EQ(areas.object_at({3.0, 0.64}), 1U) << "its length is along y";
  EXPECT_EQ(areas.object_at({3.0, 0.66}), MappedAreas::kNone);
  EXPECT_EQ(areas.object_at({3.34, 0.0}), 1U);
  EXPECT_EQ(areas.object_at({3.36, 0.0}), MappedAreas::kNone);
  EXPECT_EQ(areas.object_at({3.3, 0.6}), 1U) << "0.14 m from the corner, outside of the ellipse that stands for it";
  EXPECT_EQ(areas.object_at({3.32, 0.62}), MappedAreas::kNone) << "0.17 m from the corner";
  areas.set({});
  EXPECT_EQ(areas.object_at({0.0, 0.0}), MappedAreas::kNone);
}

TEST(MappedAreas, TheLegsOfAPersonAreOnThePerson) {
  Object person = ellipse(7, {{2.0, 1.0}, 0.0, 0.2, 0.2});
  MappedAreas areas;
  areas.set(map_of({person}));
  EXPECT_EQ(areas.object_at({2.5, 1.0}), MappedAreas::kNone);
  person.object_class = ObjectClass::kPerson;
  areas.set(map_of({person}));
  EXPECT_EQ(areas.object_at({2.5, 1.0}), 0U) << "a step of 0.9 m, and half a leg";
  EXPECT_EQ(areas.object_at({2.65, 1.0}), MappedAreas::kNone);
}

TEST(MappedAreas, OfSeveralObjectsItIsTheOneWithTheNearestOutline) {
  MappedAreas areas;
  areas.set(map_of({ellipse(1, {{0.0, 0.0}, 0.0, 1.0, 1.0}), ellipse(2, {{0.0, 0.0}, 0.0, 0.3, 0.3})}));
  EXPECT_EQ(areas.object_at({0.35, 0.0}), 1U);
  EXPECT_EQ(areas.object_at({0.9, 0.0}), 0U);
}

TEST(UnmappedSegments, CountsCompactSegmentsWithoutAnyHitOnAnObject) {
  HandMade scan(1.0);
  scan.add({2.0, 0.0}, 8).add({4.0, 0.0}, 7).add({6.0, 0.0}, 30, SegmentKind::kStructure).add({8.0, 0.0}, 20);
  UnmappedSegments unmapped;
  const Unmapped none = unmapped.add(scan.segments, {});
  EXPECT_EQ(none.compact, 2) << "7 hits are too few, structure does not count";
  EXPECT_EQ(none.on_no_map, 2);

  // Its last hit is at y = 0.19 m.
  const Unmapped one = unmapped.add(scan.segments, map_of({ellipse(1, {{8.0, 0.43}, 0.0, 0.1, 0.1})}));
  EXPECT_EQ(one.compact, 2);
  EXPECT_EQ(one.on_no_map, 1) << "0.14 m from its last hit";
  EXPECT_EQ(unmapped.add(scan.segments, map_of({ellipse(1, {{8.0, 0.45}, 0.0, 0.1, 0.1})})).on_no_map, 2) << "0.16 m";
}

TEST(UnmappedSegments, ComparesInTheWorld) {
  const Pose2 T_world_level{{10.0, -3.0}, 0.5 * kPi};
  HandMade scan(1.0, T_world_level);
  scan.add({2.0, 0.0}, 10);
  UnmappedSegments unmapped;
  EXPECT_EQ(unmapped.add(scan.segments, map_of({ellipse(1, {{2.0, 0.0}, 0.0, 0.2, 0.2})})).on_no_map, 1);
  EXPECT_EQ(unmapped.add(scan.segments, map_of({ellipse(1, {{10.0, -1.0}, 0.0, 0.2, 0.2})})).on_no_map, 0);
}

TEST(UnmappedSegments, APlaceIsUnmappedUntilItIsMapped) {
  UnmappedSegments unmapped;
  const Objects map = map_of({ellipse(1, {{2.0, 0.05}, 0.0, 0.1, 0.1})});
  for (int i = 0; i <= 6; ++i) {
    const Unmapped now = unmapped.add(HandMade(1.0 + 0.1 * i).add({2.0, 0.0}, 10).segments, {});
    EXPECT_NEAR(now.for_s, 0.1 * i, 1e-6);
    EXPECT_EQ(now.longest_s, now.for_s);
  }
  const Unmapped mapped = unmapped.add(HandMade(1.7).add({2.0, 0.0}, 10).segments, map);
  EXPECT_EQ(mapped.on_no_map, 0);
  EXPECT_EQ(mapped.for_s, 0.0);
  EXPECT_NEAR(mapped.longest_s, 0.6, 1e-6);
  const Unmapped lost = unmapped.add(HandMade(1.8).add({2.0, 0.0}, 10).segments, {});
  EXPECT_EQ(lost.for_s, 0.0) << "from now on";
  EXPECT_NEAR(lost.longest_s, 0.6, 1e-6);
}

TEST(UnmappedSegments, APlaceEndsWhereStructureIsSeen) {
  UnmappedSegments unmapped;
  unmapped.add(HandMade(1.0).add({2.0, 0.0}, 10).segments, {});
  unmapped.add(HandMade(1.2).add({2.3, 0.0}, 10, SegmentKind::kStructure).segments, {});
  EXPECT_NEAR(unmapped.add(HandMade(1.4).add({2.0, 0.0}, 10).segments, {}).for_s, 0.4, 1e-6) << "a wall behind it";
  unmapped.add(HandMade(1.6).add({2.05, -1.0}, 200, SegmentKind::kStructure).segments, {});
  EXPECT_EQ(unmapped.add(HandMade(1.8).add({2.0, 0.0}, 10).segments, {}).for_s, 0.0);
}

TEST(UnmappedSegments, APlaceMovesWithItsSegment) {
  UnmappedSegments unmapped;
  Unmapped now;
  for (int i = 0; i <= 10; ++i) {  // at 1.5 m/s; another begins later, beside it
    HandMade scan(1.0 + 0.2 * i);
    scan.add({2.0, 0.3 * i}, 10);
    if (i > 7) scan.add({3.0, 0.3 * i}, 10);
    now = unmapped.add(scan.segments, {});
  }
  EXPECT_EQ(now.on_no_map, 2);
  EXPECT_NEAR(now.for_s, 2.0, 1e-6);
  for (int i = 11; i <= 13; ++i) now = unmapped.add(HandMade(1.0 + 0.2 * i).add({3.0, 0.3 * i}, 10).segments, {});
  EXPECT_NEAR(now.for_s, 1.0, 1e-6) << "the other one, from 2.6 s to 3.6 s";
}

TEST(UnmappedSegments, AGapOfHalfASecondEndsAPlace) {
  UnmappedSegments unmapped;
  unmapped.add(HandMade(1.0).add({2.0, 0.0}, 10).segments, {});
  unmapped.add(HandMade(1.3).add({2.0, 0.0}, 7).segments, {});  // too few hits
  EXPECT_NEAR(unmapped.add(HandMade(1.45).add({2.0, 0.0}, 10).segments, {}).for_s, 0.45, 1e-6);
  unmapped.add(HandMade(1.7).segments, {});
  EXPECT_EQ(unmapped.add(HandMade(2.0).add({2.0, 0.0}, 10).segments, {}).for_s, 0.0);
}

TEST(UnmappedSegments, AStampThatGoesBackIsARestart) {
  UnmappedSegments unmapped;
  for (int i = 0; i < 5; ++i) unmapped.add(HandMade(100.0 + 0.1 * i).add({2.0, 0.0}, 10).segments, {});
  const Unmapped now = unmapped.add(HandMade(1.0).add({2.0, 0.0}, 10).segments, {});
  EXPECT_EQ(now.for_s, 0.0);
  EXPECT_NEAR(now.longest_s, 0.4, 1e-6);
}

/// Four cylinders, one of which moves, before a wall, at 20 Hz.
std::vector<Unmapped> flown(const DetectionParams& detections, int scans) {
  ObjectPipelineParams params = load_object_pipeline_params(kSource + "/cfg/objects.yaml", kSource + "/models");
  params.detections.min_p_ellipse = detections.min_p_ellipse;
  params.detections.boxes = detections.boxes;
  ObjectPipeline pipeline(params);
  Random random(1);
  std::vector<Unmapped> result;
  for (int i = 0; i < scans; ++i) {
    LevelScene scene;
    scene.walls = {{{6.0, -8.0}, {6.0, 8.0}}};
    scene.ellipses = {{{3.0, -1.0}, 0.3, 0.3, 0.2},
                      {{2.0, 1.5}, 0.0, 0.2, 0.2},
                      {{4.0, -2.5 + 0.05 * i}, 0.5, 0.25, 0.15},
                      {{1.5, -3.0}, 0.0, 0.15, 0.15}};
    Scan scan = scene.scan(&random);
    scan.stamp_ns = 1'000'000'000 + i * std::int64_t{50'000'000};
    result.push_back(pipeline.process(scan, Eigen::Isometry3d::Identity()).unmapped);
  }
  return result;
}

TEST(UnmappedSegments, NothingCompactIsOnNoMapForHalfASecond) {
  const std::vector<Unmapped> unmapped = flown({}, 60);
  EXPECT_LT(unmapped.back().longest_s, 0.5);
  for (std::size_t i = 10; i < unmapped.size(); ++i) {
    EXPECT_GE(unmapped[i].compact, 3) << i;
    EXPECT_EQ(unmapped[i].on_no_map, 0) << i;
  }
}

TEST(UnmappedSegments, WhatTheDetectorRefusesIsOnNoMap) {
  DetectionParams ellipses_alone;
  ellipses_alone.boxes = false;
  ellipses_alone.min_p_ellipse = 1.0;
  const std::vector<Unmapped> unmapped = flown(ellipses_alone, 21);
  EXPECT_GE(unmapped.back().compact, 3);
  EXPECT_EQ(unmapped.back().on_no_map, unmapped.back().compact);
  EXPECT_NEAR(unmapped.back().for_s, 1.0, 1e-6);
}

}  // namespace
}  // namespace situation_awareness::unmapped_segments_test
