// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/people.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/box.hpp"
#include "situation_awareness/map/objects/object_map.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness::people_test {
namespace {

constexpr double kPeriod_s = 0.05;
constexpr double kSeen_m = 0.01;
constexpr double kLeg_m = 0.06;
constexpr double kHip_m = 0.1;

/// A person on a straight way, of whom one foot stands while the other swings past it.
struct Walker {
  Eigen::Vector2d from_m;
  Eigen::Vector2d velocity_m_s;
  double step_s = 0.55;
  double phase = 0.0;
  double swing = 1.0;  ///< of a foot, in steps; it stands for 2 - swing

  Eigen::Vector2d middle_m(double time_s) const { return from_m + time_s * velocity_m_s; }

  std::vector<Ellipse> legs(double time_s) const {
    const double speed = velocity_m_s.norm();
    const Eigen::Vector2d ahead = speed > 0.0 ? Eigen::Vector2d(velocity_m_s / speed) : Eigen::Vector2d(1.0, 0.0);
    const Eigen::Vector2d left(-ahead.y(), ahead.x());
    std::vector<Ellipse> result;
    for (const double side : {1.0, -1.0}) {
      // Backward at `speed` about the middle while it stands, forward in the air.
      double steps = time_s / step_s + phase + (side < 0.0 ? 1.0 : 0.0);
      steps -= 2.0 * std::floor(0.5 * steps);
      const double stance = 2.0 - swing;
      const double ahead_of_middle = steps < stance ? 0.5 - steps / stance : (steps - stance) / swing - 0.5;
      const double offset_m = speed * step_s * stance * ahead_of_middle;
      result.push_back({middle_m(time_s) + side * kHip_m * left + offset_m * ahead, 0.0, kLeg_m, kLeg_m});
    }
    return result;
  }
};

Detections detections_of(double time_s, const std::vector<Ellipse>& things_world, Random& random,
                         const Pose2& T_world_level = {}) {
  Detections detections;
  detections.stamp_ns = nanoseconds(1.0 + time_s);
  detections.T_world_level = T_world_level;
  for (const Ellipse& thing : things_world) {
    Vector5d smooth = smooth_parameters(inverse(T_world_level) * thing);
    smooth += kSeen_m * normal_vector<5>(random);
    smooth(2) = std::max(smooth(2), smooth.tail<2>().norm() + 0.01);
    Detection detection;
    detection.ellipse_level = canonical(ellipse_from_smooth_parameters(smooth));
    detection.covariance = kSeen_m * kSeen_m * Matrix5d::Identity();
    detection.beams = 8;
    detections.detections.push_back(detection);
  }
  return detections;
}

void append(const std::vector<Ellipse>& more, std::vector<Ellipse>& things) {
  things.insert(things.end(), more.begin(), more.end());
}

Objects now(const ObjectMap& map) { return map.at(map.stamp_ns()); }

/// The objects of the map within 0.5 m.
std::vector<Object> objects_at(const ObjectMap& map, const Eigen::Vector2d& place_m) {
  std::vector<Object> result;
  for (const Object& object : now(map).objects) {
    if ((object.ellipse_world.center_m - place_m).norm() < 0.5) result.push_back(object);
  }
  return result;
}

int persons_on(const ObjectMap& map) {
  const Objects objects = now(map);
  return static_cast<int>(std::count_if(objects.objects.begin(), objects.objects.end(), [](const Object& object) {
    return object.object_class == ObjectClass::kPerson;
  }));
}

TEST(People, TwoLegsThatWalkAreOnePersonWithOneId) {
  for (const double speed : {0.5, 1.0, 1.5}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      ObjectMap map{ObjectMapParams{}};
      Random random(seed);
      const Walker walker{{3.0, -4.0}, {0.0, speed}, 0.55, 0.37 * static_cast<double>(seed)};
      std::set<std::uint64_t> ids;
      int scans = 0, of_one = 0;
      double squares_m2 = 0.0;
      for (double time_s = 0.0; time_s < 10.0; time_s += kPeriod_s) {
        map.update(detections_of(time_s, walker.legs(time_s), random));
        if (time_s < 1.5) continue;
        const std::vector<Object> objects = objects_at(map, walker.middle_m(time_s));
        ++scans;
        if (objects.size() != 1) continue;
        ++of_one;
        ids.insert(objects[0].id);
        squares_m2 += (objects[0].ellipse_world.center_m - walker.middle_m(time_s)).squaredNorm();
      }
      EXPECT_EQ(of_one, scans) << speed << " m/s, seed " << seed;
      EXPECT_EQ(ids.size(), 1U) << speed << " m/s, seed " << seed;
      EXPECT_LT(std::sqrt(squares_m2 / std::max(of_one, 1)), 0.05) << speed << " m/s, seed " << seed;
      ASSERT_EQ(now(map).objects.size(), 1U);
      EXPECT_EQ(now(map).objects[0].object_class, ObjectClass::kPerson);
      EXPECT_GT(now(map).objects[0].p_class, 0.9);
      EXPECT_NEAR(now(map).objects[0].velocity_world_m_s.y(), speed, 0.25);
    }
  }
}

TEST(People, SwiftLegsAtTenScansPerSecondAreOnePerson) {
  for (const double speed : {0.7, 1.0, 1.4}) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      ObjectMap map{ObjectMapParams{}};
      Random random(seed);
      const Walker walker{{3.0, -5.0}, {0.0, speed}, 0.5, 0.37 * static_cast<double>(seed), 0.7};
      std::set<std::uint64_t> ids;
      int scans = 0, of_one = 0;
      for (double time_s = 0.0; time_s < 8.0; time_s += 0.1) {
        map.update(detections_of(time_s, walker.legs(time_s), random));
        if (time_s < 2.0) continue;
        ++scans;
        const std::vector<Object> objects = objects_at(map, walker.middle_m(time_s));
        if (objects.size() != 1) continue;
        ++of_one;
        ids.insert(objects[0].id);
        EXPECT_EQ(objects[0].object_class, ObjectClass::kPerson);
      }
      EXPECT_EQ(of_one, scans) << speed << " m/s, seed " << seed;
      EXPECT_EQ(ids.size(), 1U) << speed << " m/s, seed " << seed;
      EXPECT_EQ(now(map).objects.size(), 1U) << speed << " m/s, seed " << seed;
    }
  }
}

TEST(People, ComesBackFromBehindSomethingWithOneLegFirst) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    ObjectMap map{ObjectMapParams{}};
    Random random(seed);
    const Walker walker{{3.0, -4.0}, {0.0, 1.0}, 0.55, 0.21 * static_cast<double>(seed)};
    std::set<std::uint64_t> ids;
    for (double time_s = 0.0; time_s < 8.0; time_s += kPeriod_s) {
      std::vector<Ellipse> legs;
      for (const Ellipse& leg : walker.legs(time_s)) {
        if (std::abs(leg.center_m.y()) > 0.4) legs.push_back(leg);  // behind something 0.8 m wide
      }
      map.update(detections_of(time_s, legs, random));
      if (time_s < 2.0 || (time_s > 3.5 && time_s < 5.0)) continue;
      const std::vector<Object> objects = objects_at(map, walker.middle_m(time_s));
      ASSERT_EQ(objects.size(), 1U) << "seed " << seed << ", " << time_s << " s";
      ids.insert(objects[0].id);
    }
    EXPECT_EQ(ids.size(), 1U) << seed;
    EXPECT_EQ(now(map).objects.size(), 1U) << seed;
    EXPECT_NEAR(now(map).objects[0].velocity_world_m_s.y(), 1.0, 0.3) << seed;
  }
}

TEST(People, WhoStandsHasOneIdFromTheFirstScanOnTheMap) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    ObjectMap map{ObjectMapParams{}};
    Random random(seed);
    const Walker standing{{3.0, 0.1 * static_cast<double>(seed)}, {0.0, 0.0}};
    std::set<std::uint64_t> ids;
    for (double time_s = 0.0; time_s < 3.0; time_s += kPeriod_s) {
      map.update(detections_of(time_s, standing.legs(time_s), random));
      const Objects objects = now(map);
      EXPECT_LE(objects.objects.size(), 1U) << "seed " << seed << ", " << time_s << " s";
      for (const Object& object : objects.objects) ids.insert(object.id);
    }
    EXPECT_EQ(ids.size(), 1U) << seed;
    EXPECT_EQ(persons_on(map), 1) << seed;
  }
}

TEST(People, ArmsBesideATorsoAreNoLegs) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    ObjectMap map{ObjectMapParams{}};
    Random random(seed);
    for (double time_s = 0.0; time_s < 8.0; time_s += kPeriod_s) {
      const Eigen::Vector2d middle_m(3.0, -4.0 + time_s);
      const double swing_m = 0.2 * std::sin(6.0 * time_s);
      std::vector<Ellipse> things{{middle_m, 0.0, 0.22, 0.12}};
      const Eigen::Vector2d arms_m[] = {middle_m + Eigen::Vector2d(0.31, swing_m),
                                        middle_m - Eigen::Vector2d(0.31, swing_m)};
      for (const Eigen::Vector2d& arm_m : arms_m) {
        if (random.uniform() < 0.3) continue;  // hidden
        things.push_back({arm_m, 0.0, 0.06, 0.05});
        // At times an arm is detected as two things.
        if (random.uniform() < 0.1) things.push_back({arm_m + Eigen::Vector2d(0.0, 0.05), 0.0, 0.04, 0.04});
      }
      map.update(detections_of(time_s, things, random));
      ASSERT_EQ(persons_on(map), 0) << "seed " << seed << ", " << time_s << " s";
    }
  }
}

TEST(People, BoxesAreNoLegs) {
  ObjectMap map{ObjectMapParams{}};
  Random random(8);
  const Walker walker{{3.0, -3.0}, {0.0, 1.0}};
  for (double time_s = 0.0; time_s < 5.0; time_s += kPeriod_s) {
    Detections detections = detections_of(time_s, walker.legs(time_s), random);
    for (Detection& detection : detections.detections) {
      detection.log_box_ratio = 5.0;
      detection.ellipse_level.rx_m = detection.ellipse_level.ry_m = 0.12;  // of smaller things the hits tell no shape
    }
    map.update(detections);
    EXPECT_EQ(persons_on(map), 0) << time_s;
  }
}

TEST(People, TwoWhoCrossKeepTheirIds) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    ObjectMap map{ObjectMapParams{}};
    Random random(seed);
    const std::vector<Walker> walkers{{{3.0, -4.0}, {0.0, 1.0}, 0.55, 0.2}, {{3.5, 4.0}, {0.0, -1.0}, 0.5, 0.7}};
    std::vector<std::uint64_t> ids;
    for (double time_s = 0.0; time_s < 8.0; time_s += kPeriod_s) {
      std::vector<Ellipse> things;
      for (const Walker& walker : walkers) append(walker.legs(time_s), things);
      map.update(detections_of(time_s, things, random));
      if (time_s < 2.0 || (time_s > 3.0 && time_s < 5.0)) continue;
      for (std::size_t k = 0; k < walkers.size(); ++k) {
        const std::vector<Object> objects = objects_at(map, walkers[k].middle_m(time_s));
        ASSERT_EQ(objects.size(), 1U) << "seed " << seed << ", " << time_s << " s";
        if (ids.size() < 2) ids.push_back(objects[0].id);
        EXPECT_EQ(objects[0].id, ids[k]) << "seed " << seed << ", " << time_s << " s";
      }
    }
  }
}

TEST(People, KeepsItsIdWhileALegIsHiddenForASecond) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    ObjectMap map{ObjectMapParams{}};
    Random random(seed);
    const Walker walker{{3.0, -4.0}, {0.0, 1.0}};
    std::uint64_t id = 0;
    for (double time_s = 0.0; time_s < 8.0; time_s += kPeriod_s) {
      std::vector<Ellipse> legs = walker.legs(time_s);
      if (time_s > 3.0 && time_s < 4.0) legs.pop_back();
      map.update(detections_of(time_s, legs, random));
      if (time_s < 2.0) continue;
      const std::vector<Object> objects = objects_at(map, walker.middle_m(time_s));
      ASSERT_EQ(objects.size(), 1U) << "seed " << seed << ", " << time_s << " s";
      if (id == 0) id = objects[0].id;
      EXPECT_EQ(objects[0].id, id) << "seed " << seed << ", " << time_s << " s";
    }
    EXPECT_EQ(now(map).objects.size(), 1U);
  }
}

TEST(People, WhoStopsStaysAPersonAndGoesOn) {
  ObjectMap map{ObjectMapParams{}};
  Random random(3);
  const Walker before{{3.0, -3.0}, {0.0, 1.0}};
  std::set<std::uint64_t> ids;
  for (double time_s = 0.0; time_s < 12.0; time_s += kPeriod_s) {
    const double walked_s = std::min(time_s, 3.0) + std::max(0.0, time_s - 9.0);
    map.update(detections_of(time_s, before.legs(walked_s), random));
    if (time_s < 2.0) continue;
    const std::vector<Object> objects = objects_at(map, before.middle_m(walked_s));
    ASSERT_EQ(objects.size(), 1U) << time_s;
    EXPECT_EQ(objects[0].object_class, ObjectClass::kPerson);
    ids.insert(objects[0].id);
    if (time_s > 6.0 && time_s < 9.0) {
      EXPECT_LT(objects[0].velocity_world_m_s.norm(), 0.1) << time_s;
    }
  }
  EXPECT_EQ(ids.size(), 1U);
}

TEST(PeopleStatistics, WhatStandsIsNoPerson) {
  const std::vector<std::vector<Ellipse>> scenes{
      {{{3.0, 0.0}, 0.0, 0.12, 0.12}, {{3.0, 0.4}, 0.0, 0.12, 0.12}},  // two posts
      {{{3.0, 0.0}, 0.0, 0.05, 0.05}, {{3.0, 0.5}, 0.0, 0.05, 0.05}},  // two thin ones
      {{{3.0, 0.0}, 0.0, 0.2, 0.2}, {{3.0, 0.45}, 0.0, 0.2, 0.2}},     // two bins
      {{{3.0, 0.0}, 0.0, 0.03, 0.03},
       {{3.0, 1.2}, 0.0, 0.03, 0.03},
       {{3.7, 0.0}, 0.0, 0.03, 0.03},
       {{3.7, 1.2}, 0.0, 0.03, 0.03}},  // a table
      {{{3.0, 0.0}, 0.0, 0.02, 0.02},
       {{3.0, 0.42}, 0.0, 0.02, 0.02},
       {{3.42, 0.0}, 0.0, 0.02, 0.02},
       {{3.42, 0.42}, 0.0, 0.02, 0.02}}};  // a chair
  for (std::size_t k = 0; k < scenes.size(); ++k) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      for (const double missed : {0.0, 0.3}) {
        ObjectMap map{ObjectMapParams{}};
        Random random(seed);
        for (double time_s = 0.0; time_s < 10.0; time_s += kPeriod_s) {
          std::vector<Ellipse> seen;
          for (const Ellipse& thing : scenes[k]) {
            if (random.uniform() >= missed) seen.push_back(thing);
          }
          map.update(detections_of(time_s, seen, random));
          ASSERT_EQ(persons_on(map), 0) << "scene " << k << ", " << missed << " missed, " << time_s << " s";
        }
        EXPECT_EQ(now(map).objects.size(), scenes[k].size()) << k;
      }
    }
  }
}

TEST(People, APostBesideThePathStaysOne) {
  const Ellipse post{{3.35, 0.0}, 0.0, 0.05, 0.05};
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    ObjectMap map{ObjectMapParams{}};
    Random random(seed);
    const Walker walker{{3.0, -3.0}, {0.0, 0.9}, 0.55, 0.3 * static_cast<double>(seed)};
    std::uint64_t post_id = 0, person_id = 0;
    for (double time_s = -1.0; time_s < 6.0; time_s += kPeriod_s) {
      std::vector<Ellipse> things{post};
      if (time_s >= 0.0) append(walker.legs(time_s), things);
      map.update(detections_of(1.0 + time_s, things, random));
      if (time_s < 1.5) continue;
      const Objects objects = now(map);
      ASSERT_EQ(objects.objects.size(), 2U) << "seed " << seed << ", " << time_s << " s";
      for (const Object& object : objects.objects) {
        const bool person = object.object_class == ObjectClass::kPerson;
        std::uint64_t& id = person ? person_id : post_id;
        if (id == 0) id = object.id;
        EXPECT_EQ(object.id, id) << "seed " << seed << ", " << time_s << " s";
        if (!person) {
          EXPECT_LT((object.ellipse_world.center_m - post.center_m).norm(), 0.03);
        }
      }
    }
  }
}

TEST(People, IsTheSameWhereverTheWorldsOriginIs) {
  const Pose2 T{{12.0, -7.0}, 1.1};
  ObjectMap here{ObjectMapParams{}}, there{ObjectMapParams{}};
  Random random(5), same(5);
  const Walker walker{{3.0, -3.0}, {0.2, 0.9}};
  for (double time_s = 0.0; time_s < 5.0; time_s += kPeriod_s) {
    Detections detections = detections_of(time_s, walker.legs(time_s), random);
    here.update(detections);
    detections.T_world_level = T * detections.T_world_level;
    there.update(detections);
    const Objects a = now(here), b = now(there);
    ASSERT_EQ(a.objects.size(), b.objects.size());
    for (std::size_t i = 0; i < a.objects.size(); ++i) {
      EXPECT_EQ(a.objects[i].id, b.objects[i].id);
      EXPECT_EQ(a.objects[i].object_class, b.objects[i].object_class);
      EXPECT_LT((T * a.objects[i].ellipse_world.center_m - b.objects[i].ellipse_world.center_m).norm(), 1e-6);
    }
  }
  EXPECT_EQ(persons_on(there), 1);
}

TEST(People, ASavedMapContinuesBitForBit) {
  for (const int saved : {4, 9, 60}) {  // found and followed
    ObjectMap map{ObjectMapParams{}};
    Random random(6);
    const Walker walker{{3.0, -3.0}, {0.0, 1.0}};
    ObjectMap restored{ObjectMapParams{}};
    for (int i = 0; i < 120; ++i) {
      std::vector<Ellipse> legs = walker.legs(i * kPeriod_s);
      if (i % 7 == 0) legs.pop_back();
      const Detections detections = detections_of(i * kPeriod_s, legs, random);
      map.update(detections);
      if (i == saved) restored.restore(map.snapshot());
      if (i > saved) restored.update(detections);
    }
    const Objects a = now(map), b = now(restored);
    ASSERT_EQ(a.objects.size(), 1U);
    ASSERT_EQ(b.objects.size(), 1U);
    EXPECT_EQ(a.objects[0].object_class, ObjectClass::kPerson);
    EXPECT_EQ(a.objects[0].id, b.objects[0].id);
    EXPECT_EQ(a.objects[0].ellipse_world.center_m, b.objects[0].ellipse_world.center_m);
    EXPECT_EQ(a.objects[0].covariance, b.objects[0].covariance);
    EXPECT_EQ(a.objects[0].p_class, b.objects[0].p_class);
  }
}

/// Both legs as one thing, which looks like a box across the way that has the half length. `sigmas`: the claimed
/// standard deviations, in those of the errors.
Detections both_in_one(double time_s, const Eigen::Vector2d& middle_m, double half_length_m, double sigmas,
                       Random& random) {
  const Box box{middle_m, 0.5 * kPi, half_length_m, 0.06};
  Detections detections = detections_of(time_s, {moment_equal_ellipse(box)}, random);
  Detection& detection = detections.detections[0];
  detection.shape = Shape::kBox;
  detection.box_level = moment_equal_box(detection.ellipse_level);
  detection.log_box_ratio = 5.0;
  detection.covariance *= sigmas * sigmas;
  return detections;
}

TEST(People, WhoStoodKeepsTheirIdWhenBothLegsAreOneThing) {
  for (const double half_length_m : {0.12, 0.18, 0.25, 0.29}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      ObjectMap map{ObjectMapParams{}};
      Random random(seed);
      const Walker walker{{3.0, -3.0}, {0.0, 1.0}};
      std::set<std::uint64_t> ids;
      for (double time_s = 0.0; time_s < 12.0; time_s += kPeriod_s) {
        const double walked_s = std::min(time_s, 3.0) + std::max(0.0, time_s - 10.0);
        const bool is_one = time_s > 7.0 && time_s < 10.0;
        map.update(is_one ? both_in_one(time_s, walker.middle_m(walked_s), half_length_m, 1.0, random)
                          : detections_of(time_s, walker.legs(walked_s), random));
        if (time_s < 2.0) continue;
        const std::vector<Object> objects = objects_at(map, walker.middle_m(walked_s));
        ASSERT_EQ(objects.size(), 1U) << half_length_m << " m, seed " << seed << ", " << time_s << " s";
        ASSERT_EQ(objects[0].object_class, ObjectClass::kPerson) << half_length_m << " m, seed " << seed;
        ids.insert(objects[0].id);
      }
      EXPECT_EQ(ids.size(), 1U) << half_length_m << " m, seed " << seed;
    }
  }
}

TEST(People, WhoseLegsWereOneThingIsAPersonOnceTheyPart) {
  for (const double speed : {0.5, 1.0, 1.5}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      ObjectMap map{ObjectMapParams{}};
      Random random(seed);
      const Walker walker{{3.0, -3.0}, {0.0, speed}, 0.55, 0.37 * static_cast<double>(seed)};
      std::set<std::uint64_t> ids;
      for (double time_s = 0.0; time_s < 3.0; time_s += kPeriod_s) {
        map.update(time_s < 0.6 ? both_in_one(time_s, walker.middle_m(time_s), 0.15, 4.0, random)
                                : detections_of(time_s, walker.legs(time_s), random));
        if (time_s < 1.0) continue;  // 0.4 s after they parted
        EXPECT_EQ(persons_on(map), 1) << speed << " m/s, seed " << seed << ", " << time_s << " s";
        for (const Object& object : objects_at(map, walker.middle_m(time_s))) ids.insert(object.id);
      }
      EXPECT_EQ(ids.size(), 1U) << speed << " m/s, seed " << seed;
    }
  }
}

TEST(People, HitsThatAreNoEllipseAreLegsOfAKnownPerson) {
  ObjectMap map{ObjectMapParams{}};
  Random random(7);
  const Walker walker{{3.0, -3.0}, {0.0, 1.0}};
  std::set<std::uint64_t> ids;
  for (double time_s = 0.0; time_s < 6.0; time_s += kPeriod_s) {
    Detections detections = detections_of(time_s, walker.legs(time_s), random);
    if (time_s > 3.0) {  // from now on three hits on each, on the near side
      detections.detections.clear();
      for (const Ellipse& leg : walker.legs(time_s)) {
        detections.small_segments.push_back({leg.center_m - 0.05 * leg.center_m.normalized(), 0.1, 0.0, 3});
      }
    }
    map.update(detections);
    if (time_s < 2.0) continue;
    const std::vector<Object> objects = objects_at(map, walker.middle_m(time_s));
    ASSERT_EQ(objects.size(), 1U) << time_s;
    ids.insert(objects[0].id);
    EXPECT_GT(objects[0].beams, 0);
  }
  EXPECT_EQ(ids.size(), 1U);
}

TEST(People, SmallSegmentsAloneMakeNoElement) {
  ObjectMap map{ObjectMapParams{}};
  for (int i = 0; i < 50; ++i) {
    Detections detections;
    detections.stamp_ns = nanoseconds(1.0 + i * kPeriod_s);
    detections.small_segments.push_back({{3.0, 0.0}, 0.1, 0.0, 3});
    map.update(detections);
  }
  EXPECT_EQ(map.size(), 0U);
}

}  // namespace
}  // namespace situation_awareness::people_test
