// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/resting_elements.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <vector>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/objects/existence.hpp"
#include "situation_awareness/map/objects/map_file.hpp"
#include "situation_awareness/map/objects/object_map.hpp"
#include "support/random_gaussian.hpp"

namespace situation_awareness::resting_elements_test {
namespace {

constexpr int kPerRoom = 8;
constexpr int kRooms = 5;
constexpr double kToNextRoom_m = 20.0;
constexpr double kReach_m = 6.0;
constexpr double kSeen_m = 0.02;
constexpr std::int64_t kStart_ns = 1'000'000'000'000;

/// A scanner that goes from room to room and back, in each of which things stand around it, some behind others.
class Patrol {
 public:
  explicit Patrol(std::uint64_t seed) : random_(seed) {
    for (int room = 0; room < kRooms; ++room) {
      for (int i = 0; i < kPerRoom; ++i) {
        const double azimuth_rad = 2.0 * kPi * i / kPerRoom;
        const double range_m = random_.uniform(2.0, 4.0);
        things_.push_back({range_m * Eigen::Vector2d(std::cos(azimuth_rad), std::sin(azimuth_rad)) +
                               Eigen::Vector2d(kToNextRoom_m * room, 0.0),
                           random_.uniform(-1.5, 1.5), random_.uniform(0.2, 0.3), random_.uniform(0.1, 0.2)});
      }
    }
  }

  /// A scan in a room, without the things for which `is_gone(index)`.
  template <class IsGone>
  Detections scan(int room, IsGone&& is_gone) {
    constexpr int kBeams = 360;
    Detections detections;
    detections.stamp_ns = stamp_ns_ += nanoseconds(0.05);
    detections.T_world_level = {{kToNextRoom_m * room + 0.1 * random_.normal(), 0.1 * random_.normal()},
                                0.1 * random_.normal()};
    const Pose2 T_level_world = inverse(detections.T_world_level);
    FreeSpace& free_space = detections.free_space;
    for (int i = 0; i < kBeams; ++i) {
      free_space.azimuth_rad.push_back(static_cast<float>(-kPi + 2.0 * kPi * i / kBeams));
      free_space.range_m.push_back(static_cast<float>(kReach_m));
    }
    free_space.full_circle = true;
    for (std::size_t k = 0; k < things_.size(); ++k) {
      if (static_cast<int>(k) / kPerRoom != room || is_gone(k)) continue;
      Vector5d smooth = smooth_parameters(T_level_world * things_[k]) + kSeen_m * normal_vector<5>(random_);
      smooth(2) = std::max(smooth(2), smooth.tail<2>().norm() + 0.05);
      Detection detection;
      detection.ellipse_level = ellipse_from_smooth_parameters(smooth);
      detection.covariance = kSeen_m * kSeen_m * Matrix5d::Identity();
      detection.beams = 20;
      detection.middle_level_m = smooth.head<2>();
      detection.segment = detections.detections.size();
      detections.detections.push_back(detection);
      const Ellipse& ellipse = detection.ellipse_level;
      const double azimuth_rad = std::atan2(ellipse.center_m.y(), ellipse.center_m.x());
      const double half_rad = std::asin(ellipse.rx_m / ellipse.center_m.norm());
      for (std::size_t i = 0; i < free_space.range_m.size(); ++i) {
        if (std::abs(wrap_to_pi(free_space.azimuth_rad[i] - azimuth_rad)) > half_rad) continue;
        free_space.range_m[i] =
            std::min(free_space.range_m[i], static_cast<float>(ellipse.center_m.norm() - ellipse.ry_m));
      }
    }
    return detections;
  }
  Detections scan(int room) {
    return scan(room, [](std::size_t /*thing*/) { return false; });
  }

  void pause(double time_s) { stamp_ns_ += nanoseconds(time_s); }
  std::int64_t stamp_ns() const { return stamp_ns_; }

 private:
  Random random_;
  std::vector<Ellipse> things_;
  std::int64_t stamp_ns_ = kStart_ns;
};

/// Scans of a patrol to the last room and back; on the way back every third thing is gone.
std::vector<Detections> scans_of_patrol(std::uint64_t seed) {
  constexpr int kScans = 50;
  Patrol patrol(seed);
  std::vector<Detections> scans;
  for (int room = 0; room < kRooms; ++room) {
    for (int i = 0; i < kScans; ++i) scans.push_back(patrol.scan(room));
    patrol.pause(1.0);
  }
  for (int room = kRooms - 2; room >= 0; --room) {
    for (int i = 0; i < kScans; ++i) {
      scans.push_back(patrol.scan(room, [](std::size_t thing) { return thing % 3 == 0; }));
    }
    patrol.pause(1.0);
  }
  return scans;
}

/// A map that takes the stamps of a patrol, with its pauses.
ObjectMap patrol_map(const ObjectMapParams& params = {}) {
  ObjectMap map(params);
  map.trust_stamps();
  return map;
}

void expect_same(const Objects& a, const Objects& b, double tolerance) {
  ASSERT_EQ(a.objects.size(), b.objects.size());
  for (std::size_t i = 0; i < a.objects.size(); ++i) {
    const Object& x = a.objects[i];
    const Object& y = b.objects[i];
    EXPECT_EQ(x.id, y.id);
    EXPECT_LE((x.ellipse_world.center_m - y.ellipse_world.center_m).norm(), tolerance);
    EXPECT_NEAR(x.ellipse_world.rx_m, y.ellipse_world.rx_m, tolerance);
    EXPECT_LE((x.covariance - y.covariance).norm(), tolerance * (1.0 + x.covariance.norm()));
    EXPECT_NEAR(x.p_exists, y.p_exists, tolerance);
    EXPECT_NEAR(x.p_moving, y.p_moving, tolerance);
    EXPECT_EQ(x.last_seen_ns, y.last_seen_ns);
    EXPECT_EQ(x.observations, y.observations);
  }
}

TEST(RestingElements, AMapThatIsAskedAfterEachScanIsThatWhichIsAskedAtTheEnd) {
  ObjectMap asked = patrol_map();
  ObjectMap silent = patrol_map();
  std::size_t deleted = 0;
  for (const Detections& scan : scans_of_patrol(1)) {
    const ObjectMapUpdate a = asked.update(scan);
    const ObjectMapUpdate b = silent.update(scan);
    EXPECT_EQ(a.updated, b.updated);
    EXPECT_EQ(a.created, b.created);
    EXPECT_EQ(a.deleted, b.deleted);
    EXPECT_EQ(a.reasons, b.reasons);
    EXPECT_EQ(asked.size(), silent.size());
    deleted += a.deleted.size();
    asked.at(asked.stamp_ns());
  }
  const Objects objects = asked.at(asked.stamp_ns());
  EXPECT_GT(objects.objects.size(), 25U);
  EXPECT_GT(deleted, 5U) << "what is gone is seen through on the way back";
  expect_same(objects, silent.at(silent.stamp_ns()), 1e-9);
}

TEST(RestingElements, KeepTheirIdsWhereTheScannerComesBack) {
  ObjectMap map = patrol_map();
  Patrol patrol(2);
  const auto ids_of = [&map] {
    std::set<std::uint64_t> ids;
    for (const Object& object : map.at(map.stamp_ns()).objects) ids.insert(object.id);
    return ids;
  };
  for (int i = 0; i < 50; ++i) map.update(patrol.scan(0));
  const std::set<std::uint64_t> before = ids_of();
  EXPECT_EQ(before.size(), static_cast<std::size_t>(kPerRoom));
  patrol.pause(1.0);
  for (int i = 0; i < 200; ++i) map.update(patrol.scan(3));
  EXPECT_EQ(map.size(), static_cast<std::size_t>(2 * kPerRoom));
  patrol.pause(1.0);
  const ObjectMapUpdate update = map.update(patrol.scan(0));
  EXPECT_EQ(std::set<std::uint64_t>(update.updated.begin(), update.updated.end()), before);
  EXPECT_TRUE(update.created.empty());
}

TEST(RestingElements, AreDeletedWhenUnseenForTooLong) {
  ObjectMapParams params;
  params.max_unseen_s = 5.0;
  ObjectMap map = patrol_map(params);
  Patrol patrol(3);
  for (int i = 0; i < 50; ++i) map.update(patrol.scan(0));
  const std::int64_t last_seen_ns = patrol.stamp_ns();
  patrol.pause(1.0);
  int scans = 0;
  for (; scans < 200; ++scans) {
    const ObjectMapUpdate update = map.update(patrol.scan(2));
    const bool is_due = patrol.stamp_ns() - last_seen_ns > nanoseconds(params.max_unseen_s);
    EXPECT_EQ(update.deleted.size(), is_due ? static_cast<std::size_t>(kPerRoom) : 0U);
    if (!is_due) continue;
    EXPECT_EQ(update.reasons.of("unseen for too long"), static_cast<std::size_t>(kPerRoom));
    break;
  }
  EXPECT_LT(scans, 200);
}

TEST(RestingElements, ARestoredMapGoesOnBitForBit) {
  const std::vector<Detections> scans = scans_of_patrol(4);
  ObjectMap map = patrol_map();
  std::size_t i = 0;
  for (; i < 130; ++i) map.update(scans[i]);
  const auto text_of = [](const ObjectMap& of) {
    MapSnapshot snapshot = of.snapshot();
    snapshot.world_frame = "world";
    return map_to_yaml(snapshot);
  };
  ObjectMap restored = patrol_map();
  restored.restore(map_from_yaml(text_of(map), "test"));
  for (; i < scans.size(); ++i) {
    map.update(scans[i]);
    restored.update(scans[i]);
  }
  EXPECT_EQ(text_of(map), text_of(restored));
}

TEST(RestingElements, OtherParametersHoldFromTheirTimeOn) {
  const std::vector<Detections> scans = scans_of_patrol(5);
  ObjectMap asked = patrol_map();
  ObjectMap silent = patrol_map();
  for (std::size_t i = 0; i < scans.size(); ++i) {
    if (i == 140) {
      ObjectMapParams params;
      params.standing_drift_m = 0.02;
      asked.set_params(params);
      silent.set_params(params);
    }
    asked.update(scans[i]);
    silent.update(scans[i]);
    asked.at(asked.stamp_ns());
  }
  expect_same(asked.at(asked.stamp_ns()), silent.at(silent.stamp_ns()), 1e-9);
}

TEST(ScanNeeds, MissesNothingThatBeamsReach) {
  Random random(6);
  int seen = 0, not_needed = 0;
  for (int trial = 0; trial < 400; ++trial) {
    Detections detections;
    detections.T_world_level = {{random.uniform(-20.0, 20.0), random.uniform(-20.0, 20.0)}, random.uniform(-kPi, kPi)};
    const int beams = 2 + static_cast<int>(random.uniform(0.0, 700.0));
    const double first_rad = random.uniform(-3.0 * kPi, kPi);
    const double field_rad = random.uniform(0.1, 2.0 * kPi);
    for (int i = 0; i < beams; ++i) {
      detections.free_space.azimuth_rad.push_back(static_cast<float>(first_rad + field_rad * i / (beams - 1)));
      const bool far = random.uniform() < 0.2;
      detections.free_space.range_m.push_back(static_cast<float>(random.uniform(0.0, far ? 30.0 : 4.0)));
    }
    ScanNeeds needs;
    needs.set(detections, {}, Eigen::Matrix3d::Identity(), 20.0, 0.0, {});
    for (int k = 0; k < 200; ++k) {
      RestingPlace place;
      const double rx_m = random.uniform(0.05, 1.0);
      place.ellipse_world = {{random.uniform(-40.0, 40.0), random.uniform(-40.0, 40.0)},
                             random.uniform(-kPi, kPi),
                             rx_m,
                             random.uniform(0.02, rx_m)};
      const bool is_hidden = look_at(inverse(detections.T_world_level) * place.ellipse_world, detections.free_space,
                                     kSightMargin_m) == Sight::kHidden;
      EXPECT_EQ(needs.needs(place), !is_hidden);
      ++(is_hidden ? not_needed : seen);
    }
  }
  EXPECT_GT(seen, 500);
  EXPECT_GT(not_needed, 500);
}

}  // namespace
}  // namespace situation_awareness::resting_elements_test
