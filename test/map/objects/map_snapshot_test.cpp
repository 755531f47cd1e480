// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/map_snapshot.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/map/objects/map_file.hpp"
#include "situation_awareness/map/objects/object_map.hpp"
#include "support/lively_scene.hpp"

namespace situation_awareness::map_snapshot_test {
namespace {

constexpr std::int64_t kStart_ns = 1'700'000'000'000'000'000;
constexpr std::int64_t kPeriod_ns = 50'000'000;
constexpr int kScans = 120;

const std::vector<Detections>& scene() {
  static const std::vector<Detections> result = lively_scene(kScans + 20, kStart_ns, 3);
  return result;
}

ObjectMap lively_map(const ObjectMapParams& params = {}) {
  ObjectMap map(params);
  for (int i = 0; i < kScans; ++i) map.update(scene()[static_cast<std::size_t>(i)]);
  return map;
}

/// The whole state of a map as text.
std::string text_of(const ObjectMap& map) {
  MapSnapshot snapshot = map.snapshot();
  snapshot.world_frame = "world";
  return map_to_yaml(snapshot);
}

std::set<std::uint64_t> ids_of(const Objects& objects) {
  std::set<std::uint64_t> ids;
  for (const Object& object : objects.objects) ids.insert(object.id);
  return ids;
}

/// The scan after the saved ones, at another time.
Detections next_scan(std::int64_t stamp_ns) {
  Detections detections = scene()[kScans];
  detections.stamp_ns = stamp_ns;
  return detections;
}

TEST(MapSnapshot, RestoresIntoAnyMap) {
  const ObjectMap map = lively_map();
  ObjectMap other{ObjectMapParams()};
  for (const Detections& detections : lively_scene(50, kStart_ns + 77, 9)) other.update(detections);
  other.restore(map.snapshot());
  EXPECT_EQ(other.stamp_ns(), map.stamp_ns());
  EXPECT_EQ(text_of(other), text_of(map));
}

TEST(MapSnapshot, NewIdsAreAboveThoseOfBothMaps) {
  const ObjectMap map = lively_map();
  const std::uint64_t next_id = map.snapshot().next_id;
  ObjectMap young{ObjectMapParams()};
  young.update(scene()[0]);
  const MapSnapshot snapshot = young.snapshot();
  ASSERT_LT(snapshot.next_id, next_id);

  ObjectMap old = map;
  old.restore(snapshot);
  EXPECT_EQ(old.snapshot().next_id, next_id);
  young.restore(map.snapshot());
  EXPECT_EQ(young.snapshot().next_id, next_id);
}

TEST(MapSnapshot, RefusesAnotherShapeAndInvalidMapsAndIsThenUnchanged) {
  ObjectMap map = lively_map();
  const std::string before = text_of(map);
  ObjectMapParams params;
  params.shape = "circle";
  EXPECT_THROW(map.restore(lively_map(params).snapshot()), std::invalid_argument);
  EXPECT_THROW(map.resume(lively_map(params).snapshot()), std::invalid_argument);
  MapSnapshot bad = map.snapshot();
  bad.elements.back().estimate.standing.P(0, 0) = std::nan("");
  EXPECT_THROW(map.restore(bad), std::invalid_argument);
  EXPECT_THROW(map.resume(bad), std::invalid_argument);
  EXPECT_EQ(text_of(map), before);
}

/// Long before, a moment later, a year later.
class Resumed : public testing::TestWithParam<std::int64_t> {};

TEST_P(Resumed, HasAllElementsAtTheirPositionsWithTheirIds) {
  const ObjectMap map = lively_map();
  const std::int64_t stamp_ns = GetParam();
  const std::int64_t later_ns = stamp_ns - map.stamp_ns();
  ObjectMap resumed{ObjectMapParams()};
  resumed.resume(map.snapshot());
  const ObjectMapUpdate update = resumed.update(next_scan(stamp_ns));
  EXPECT_EQ(resumed.stamp_ns(), stamp_ns);

  // The uninterrupted map, up to the motion of one period.
  ObjectMap went_on = map;
  const ObjectMapUpdate expected = went_on.update(next_scan(map.stamp_ns() + kPeriod_ns));
  EXPECT_EQ(update.updated, expected.updated);
  EXPECT_EQ(update.created, expected.created);
  EXPECT_EQ(update.deleted, expected.deleted);
  EXPECT_EQ(update.reasons, expected.reasons);
  const Objects a = resumed.at(resumed.stamp_ns());
  const Objects b = went_on.at(went_on.stamp_ns());
  ASSERT_EQ(ids_of(a), ids_of(b));
  ASSERT_GT(a.objects.size(), 5U);
  for (std::size_t i = 0; i < a.objects.size(); ++i) {
    EXPECT_LT((a.objects[i].ellipse_world.center_m - b.objects[i].ellipse_world.center_m).norm(), 0.06);
    EXPECT_NEAR(a.objects[i].p_exists, b.objects[i].p_exists, 0.01);
    EXPECT_EQ(a.objects[i].observations, b.objects[i].observations);
    const bool seen_now = b.objects[i].last_seen_ns == went_on.stamp_ns();
    EXPECT_EQ(a.objects[i].last_seen_ns, seen_now ? stamp_ns : b.objects[i].last_seen_ns + later_ns);
    EXPECT_EQ(a.objects[i].first_seen_ns, b.objects[i].first_seen_ns + later_ns);
  }

  // Afterwards time counts again.
  EXPECT_EQ(resumed.update(next_scan(stamp_ns)).reasons.of("stamp repeats"), 1U);
  for (int i = 1; i < 10; ++i) {
    Detections detections = scene()[static_cast<std::size_t>(kScans + i)];
    detections.stamp_ns = stamp_ns + i * kPeriod_ns;
    resumed.update(detections);
  }
  EXPECT_EQ(resumed.stamp_ns(), stamp_ns + 9 * kPeriod_ns);
}

INSTANTIATE_TEST_SUITE_P(AtAnyTime, Resumed,
                         testing::Values(0, nanoseconds(5.0), kStart_ns - nanoseconds(3600.0),
                                         kStart_ns + (kScans - 1) * kPeriod_ns, kStart_ns + kScans * kPeriod_ns,
                                         kStart_ns + nanoseconds(3.2e7)));

TEST(MapSnapshot, IsResumedByARunningMapAtItsOwnTime) {
  const ObjectMap saved = lively_map();
  ObjectMap running{ObjectMapParams()};
  const std::int64_t now_ns = nanoseconds(500.0);
  running.update(next_scan(now_ns));
  running.resume(saved.snapshot());
  EXPECT_EQ(running.stamp_ns(), now_ns);
  EXPECT_EQ(ids_of(running.at(now_ns)), ids_of(saved.at(saved.stamp_ns())));
  // Its clock is reset before the next scan: the loaded map is kept.
  running.update(next_scan(nanoseconds(1.0)));
  EXPECT_EQ(running.stamp_ns(), nanoseconds(1.0));
  EXPECT_EQ(ids_of(running.at(running.stamp_ns())), ids_of(saved.at(saved.stamp_ns())));
}

TEST(MapSnapshot, SavedAgainBeforeTheNextScanItIsTheSame) {
  const ObjectMap saved = lively_map();
  ObjectMap loaded{ObjectMapParams()};
  loaded.resume(saved.snapshot());
  EXPECT_EQ(text_of(loaded), text_of(saved));
}

/// The detection of a barrel from there.
Detections barrel_from(const Pose2& T_world_level, std::int64_t stamp_ns) {
  Detections detections;
  detections.stamp_ns = stamp_ns;
  detections.T_world_level = T_world_level;
  Detection detection;
  detection.ellipse_level = inverse(T_world_level) * Ellipse{{3.0, 1.0}, 0.0, 0.3, 0.3};
  detection.covariance = 1e-4 * Matrix5d::Identity();
  detection.beams = 20;
  detections.detections.push_back(detection);
  return detections;
}

TEST(MapSnapshot, ThePoseOfTheRobotAtSavingIsNotUsed) {
  ObjectMap saved{ObjectMapParams()};
  for (int i = 0; i < 10; ++i) saved.update(barrel_from({}, kStart_ns + i * kPeriod_ns));
  const double before_m = std::sqrt(saved.at(saved.stamp_ns()).objects.at(0).covariance(0, 0));

  const Pose2 elsewhere{{6.0, 1.0}, 2.5};
  const auto sigma_after_m = [&](ObjectMap map, std::int64_t stamp_ns) {
    map.update(barrel_from(elsewhere, stamp_ns));
    const Objects objects = map.at(stamp_ns);
    EXPECT_EQ(ids_of(objects), (std::set<std::uint64_t>{1}));
    return std::sqrt(objects.objects.at(0).covariance(0, 0));
  };
  ObjectMap resumed{ObjectMapParams()};
  resumed.resume(saved.snapshot());
  EXPECT_LT(sigma_after_m(resumed, nanoseconds(10.0)), before_m) << "a detection from another side says something";
  // As a motion within one period, 6 m would prevent every match, with stamps 2 ms apart.
  EXPECT_GE(sigma_after_m(saved, saved.stamp_ns() + kPeriod_ns), before_m - 1e-4);
}

TEST(ObjectMapReset, DeletesAllButTheIdsAndAcceptsAnyTime) {
  ObjectMap map = lively_map();
  const std::uint64_t next_id = map.snapshot().next_id;
  map.reset();
  EXPECT_EQ(map.stamp_ns(), ObjectMap::kNoStamp);
  EXPECT_TRUE(map.at(kStart_ns).objects.empty());

  // It continues like a new map.
  ObjectMap fresh{ObjectMapParams()};
  for (const Detections& detections : lively_scene(60, nanoseconds(3.0), 4)) {
    const ObjectMapUpdate a = map.update(detections);
    const ObjectMapUpdate b = fresh.update(detections);
    ASSERT_EQ(a.log_likelihood, b.log_likelihood);
    ASSERT_EQ(a.reasons, b.reasons);
  }
  const Objects a = map.at(map.stamp_ns());
  const Objects b = fresh.at(fresh.stamp_ns());
  ASSERT_EQ(a.objects.size(), b.objects.size());
  ASSERT_GT(a.objects.size(), 5U);
  for (std::size_t i = 0; i < a.objects.size(); ++i) {
    EXPECT_EQ(a.objects[i].id, b.objects[i].id + next_id - 1);
    EXPECT_EQ(a.objects[i].covariance, b.objects[i].covariance);
  }
}

TEST(ObjectMapReset, DeletesLoadedElementsToo) {
  ObjectMap map{ObjectMapParams()};
  map.resume(lively_map().snapshot());
  map.reset();
  map.update(next_scan(nanoseconds(2.0)));
  for (const MapElement& element : map.snapshot().elements) EXPECT_EQ(element.observations, 1);
}

}  // namespace
}  // namespace situation_awareness::map_snapshot_test
