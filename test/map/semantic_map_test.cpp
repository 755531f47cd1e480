// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/semantic_map.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <variant>
#include <vector>

#include <gtest/gtest.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/map/map_replica.hpp"

namespace situation_awareness::semantic_map_test {
namespace {

/// All of a feature, to compare it.
std::string text_of(const Feature& feature) {
  std::ostringstream text;
  text << feature.id << ' ' << kind_of(feature.shape) << ' ' << name_of(feature.object_class) << ' ' << feature.p_class
       << ' ' << feature.p_exists << ' ' << feature.p_moving << ' ' << name_of(feature.motion) << ' '
       << feature.first_seen_ns << ' ' << feature.last_seen_ns << ' ' << feature.last_absent_ns.value_or(-1) << ' '
       << feature.first_absent_ns.value_or(-1) << ' ' << feature.seen_by.scan << feature.seen_by.camera;
  if (const auto* line = std::get_if<PolylineShape>(&feature.shape)) {
    for (const ChainVertex& vertex : line->vertices) text << ' ' << vertex.p_world_m.transpose();
  }
  if (const auto* box = std::get_if<BoxShape>(&feature.shape)) text << ' ' << box->box_world.center_m.transpose();
  return text.str();
}

/// What two layers see, and the map of it, at 10 Hz. What the updates tell is what the map says.
class Scene {
 public:
  Object& box(std::uint64_t handle, const Eigen::Vector2d& center_m, double half_length_m = 2.0,
              double half_width_m = 0.9) {
    for (Object& object : objects_.objects) {
      if (object.id == handle) return place(object, center_m);
    }
    Object object;
    object.id = handle;
    object.shape = Shape::kBox;
    object.box_world = {center_m, 0.0, half_length_m, half_width_m};
    object.covariance = 1e-4 * Matrix8d::Identity();
    object.first_seen_ns = stamp_ns_;
    objects_.objects.push_back(object);
    return place(objects_.objects.back(), center_m);
  }
  void lose(std::uint64_t handle) {
    objects_.objects.erase(std::remove_if(objects_.objects.begin(), objects_.objects.end(),
                                          [&](const Object& object) { return object.id == handle; }),
                           objects_.objects.end());
  }
  void chain(std::uint64_t handle, const std::vector<Eigen::Vector2d>& points_m, ChainState state = ChainState::kNew) {
    Chain& chain = chains_[handle];
    if (chain.id == 0) chain.first_seen_ns = stamp_ns_;
    chain.id = handle;
    chain.last_seen_ns = stamp_ns_;
    chain.p_exists = 0.99;
    chain.state = state;
    chain.vertices.clear();
    for (const Eigen::Vector2d& p_m : points_m) chain.vertices.push_back({p_m, 0.01});
    changed_.insert(handle);
  }
  /// Beams have passed a part of a chain.
  void doubt(std::uint64_t handle) {
    chains_[handle].p_exists = 0.4;
    changed_.insert(handle);
  }
  void drop(std::uint64_t handle) {
    chains_.erase(handle);
    changed_.erase(handle);
    gone_.insert(handle);
  }

  /// A boundary, given by its middle, radius and the chains that it was fitted to; as `n` arcs.
  void boundary(std::uint64_t handle, const Eigen::Vector2d& center_m, double radius_m,
                const std::vector<std::uint64_t>& chains, int n = 8) {
    Splinegon splinegon;
    splinegon.id = handle;
    splinegon.closed = true;
    for (int k = 0; k < n; ++k) {
      const double angle_rad = 2.0 * kPi * k / n;
      splinegon.vertices.push_back({center_m + radius_m * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad)),
                                    std::tan(0.5 * kPi / n), 0.01, false});
    }
    leave_boundary(handle);
    boundaries_.boundaries.push_back(splinegon);
    for (const std::uint64_t chain : chains) of_boundaries_[chain] = handle;
  }
  /// The chain is of no boundary any more.
  void leave_chain(std::uint64_t chain) { of_boundaries_.erase(chain); }
  void leave_boundary(std::uint64_t handle) {
    auto& all = boundaries_.boundaries;
    all.erase(std::remove_if(all.begin(), all.end(), [&](const Splinegon& other) { return other.id == handle; }),
              all.end());
  }
  void target(std::uint64_t handle, const Eigen::Vector2d& p_world_m) {
    GridTarget target;
    target.id = handle;
    target.p_world_m << p_world_m, 0.0;
    target.covariance_m2 = 0.04 * Eigen::Matrix2d::Identity();
    target.area_m2 = 7.0;
    target.probability = 0.8;
    targets_.targets.push_back(target);
  }
  /// With what target() said since the image before.
  void image() {
    targets_.stamp_ns = stamp_ns_;
    LayerUpdates layers;
    layers.stamp_ns = stamp_ns_;
    layers.targets = &targets_;
    follow(map_.update(layers));
    targets_.targets.clear();
  }
  /// Goes on from a map that was saved in another program, 100 s later by its clock, by a new map of the layers.
  void resume(const Map& saved, const std::vector<FeatureOfChain>& chains) {
    forget();
    ids_.resume(1000);
    stamp_ns_ = saved.stamp_ns + 100'000'000'000;
    map_.resume(saved, chains);
  }
  void begin_anew() {
    map_.begin_anew();
    forget();
  }
  void forget() {
    objects_.objects.clear();
    chains_.clear();
    changed_.clear();
    gone_.clear();
    boundaries_.boundaries.clear();
    of_boundaries_.clear();
    listener_.clear();
  }

  void scan(double duration_s = 0.1) {
    for (double spent_s = 0.0; spent_s < duration_s - 1e-6; spent_s += 0.1) {
      stamp_ns_ += 100'000'000;
      objects_.stamp_ns = stamp_ns_;
      for (Object& object : objects_.objects) {
        if (objects_go_on) object.last_seen_ns = stamp_ns_;
      }
      PolygonChanges changes;
      for (const std::uint64_t handle : changed_) changes.changed.push_back(&chains_[handle]);
      changes.gone.assign(gone_.begin(), gone_.end());
      changed_.clear();
      gone_.clear();
      std::vector<ChainOfBoundary> chains;
      for (const auto& [chain, boundary] : of_boundaries_) {
        if (chains_.count(chain) > 0) chains.push_back({chain, boundary});
      }
      const BoundaryChanges boundaries{&boundaries_, &chains};
      LayerUpdates layers{stamp_ns_, 0.0, with_objects ? &objects_ : nullptr, &changes, &boundaries, nullptr, {}};
      if (!free_space_.azimuth_rad.empty()) layers.sight = {{}, &free_space_};
      follow(map_.update(layers));
    }
  }

  /// From now on the scans say that all is free around the origin, up to there.
  void see(double range_m) {
    free_space_ = {};
    for (int i = -180; i < 180; ++i) {
      free_space_.azimuth_rad.push_back(static_cast<float>(kPi * i / 180.0));
      free_space_.range_m.push_back(static_cast<float>(range_m));
    }
    free_space_.full_circle = true;
  }

  /// "id kind" of each feature, by id.
  std::vector<std::string> features() const {
    std::vector<std::string> result;
    for (const Feature& feature : map_.map().features) {
      result.push_back(std::to_string(feature.id) + " " + kind_of(feature.shape));
    }
    return result;
  }
  const std::vector<Gone>& gone() const { return told_gone_; }
  /// What the updates said last of a feature.
  const Feature& last(FeatureId id) const { return last_.at(id); }
  std::int64_t stamp_ns() const { return stamp_ns_; }
  Map map() const { return map_.map(); }
  FeatureId upcoming() const { return ids_.upcoming(); }

  bool with_objects = true;   ///< else their layer does not tell of them any more
  bool objects_go_on = true;  ///< else it repeats them, with new stamps

 private:
  static Object& place(Object& object, const Eigen::Vector2d& center_m) {
    object.box_world.center_m = center_m;
    object.ellipse_world = moment_equal_ellipse(object.box_world);
    return object;
  }
  /// A listener that has the updates alone has the map.
  void follow(const MapDelta& update) {
    EXPECT_EQ(update.base, update.full ? 0 : version_);
    version_ = update.version;
    for (const Feature& feature : update.changed) {
      listener_[feature.id] = text_of(feature);
      last_[feature.id] = feature;
    }
    std::map<FeatureId, std::string> there;
    for (const Feature& feature : map_.map().features) there[feature.id] = text_of(feature);
    for (const Gone& gone : update.gone) {
      EXPECT_EQ(listener_.erase(gone.id), 1U) << gone.id;
      EXPECT_EQ(gone.into.has_value(), gone.reason == GoneReason::kMerged);
      EXPECT_EQ(there.count(gone.into.value_or(0)), gone.into ? 1U : 0U) << gone.id;
      told_gone_.push_back(gone);
    }
    EXPECT_EQ(listener_, there);
    EXPECT_EQ(map_.size(), there.size());
    EXPECT_EQ(replica_.apply(update), MapReplica::Verdict::kTaken);
    std::map<FeatureId, std::string> copied;
    for (const Feature& feature : replica_.map().features) copied[feature.id] = text_of(feature);
    EXPECT_EQ(copied, there);
    EXPECT_EQ(replica_.map().features.size(), there.size());
    EXPECT_EQ(replica_.map().objects_stamp_ns, map_.map().objects_stamp_ns);
    EXPECT_EQ(replica_.apply(update), MapReplica::Verdict::kKnown);
  }

  IdSource ids_;
  SemanticMap map_{HandOverParams{}, ids_};
  std::int64_t stamp_ns_ = 1'000'000'000'000;
  Objects objects_;
  std::map<std::uint64_t, Chain> chains_;
  std::set<std::uint64_t> changed_, gone_;
  Splinegons boundaries_;
  std::map<std::uint64_t, std::uint64_t> of_boundaries_;  ///< by chain
  GridTargets targets_;
  FreeSpace free_space_;
  std::map<FeatureId, std::string> listener_;
  std::map<FeatureId, Feature> last_;
  MapReplica replica_;
  std::vector<Gone> told_gone_;
  std::uint64_t version_ = 0;
};

using Features = std::vector<std::string>;

MapDelta delta_of(std::uint64_t base, std::uint64_t version, bool full, const std::vector<FeatureId>& changed,
                  const std::vector<FeatureId>& gone = {}, std::uint64_t map = 1) {
  MapDelta delta;
  delta.map = map;
  delta.base = base;
  delta.version = version;
  delta.full = full;
  for (const FeatureId id : changed) delta.changed.emplace_back().id = id;
  for (const FeatureId id : gone) delta.gone.push_back({id, GoneReason::kLeft, {}});
  return delta;
}

TEST(MapReplica, TakesWhatFitsAndAwaitsAFullUpdateWhereOneWasMissed) {
  MapReplica replica;
  const auto ids = [&] {
    std::vector<FeatureId> result;
    for (const Feature& feature : replica.map().features) result.push_back(feature.id);
    return result;
  };
  using Verdict = MapReplica::Verdict;
  EXPECT_EQ(replica.apply(delta_of(3, 4, false, {7})), Verdict::kMissed);
  EXPECT_FALSE(replica.has_map());
  EXPECT_EQ(replica.apply(delta_of(0, 4, true, {2, 7})), Verdict::kTaken);
  EXPECT_EQ(replica.apply(delta_of(4, 5, false, {1, 5, 9}, {2, 8})), Verdict::kTaken);
  EXPECT_EQ(ids(), std::vector<FeatureId>({1, 5, 7, 9}));
  EXPECT_EQ(replica.find(5)->id, 5U);
  EXPECT_EQ(replica.find(2), nullptr);
  EXPECT_EQ(replica.apply(delta_of(4, 5, false, {}, {1})), Verdict::kKnown);
  EXPECT_EQ(replica.apply(delta_of(0, 5, true, {})), Verdict::kKnown);
  EXPECT_EQ(replica.apply(delta_of(6, 7, false, {}, {1})), Verdict::kMissed);
  EXPECT_EQ(replica.apply(delta_of(5, 6, false, {}, {1}, 2)), Verdict::kMissed) << "another map";
  EXPECT_EQ(ids(), std::vector<FeatureId>({1, 5, 7, 9}));
  EXPECT_EQ(replica.apply(delta_of(0, 7, true, {3})), Verdict::kTaken);
  EXPECT_EQ(ids(), std::vector<FeatureId>({3}));
  EXPECT_EQ(replica.apply(delta_of(0, 1, true, {4}, {}, 2)), Verdict::kTaken);
  EXPECT_EQ(ids(), std::vector<FeatureId>({4}));
}

/// The sides of a box of 4 m x 1.8 m that are seen from the south-west.
std::vector<Eigen::Vector2d> sides_at(double x, double y) {
  return {{x - 2.0, y + 0.9}, {x - 2.0, y - 0.9}, {x + 2.0, y - 0.9}};
}

TEST(SemanticMap, AThingThatBothLayersSeeIsThereOnce) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 box"}));
  scene.chain(3, sides_at(5.0, 0.0));
  scene.scan(9.0);
  EXPECT_EQ(scene.features(), Features({"1 box"}));
  scene.scan(2.0);
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  EXPECT_TRUE(scene.gone().empty());
}

TEST(SemanticMap, TellsWhenAThingWasNotThereYet) {
  Scene scene;
  scene.see(8.0);
  scene.scan(3.0);
  scene.box(7, {5.0, 0.0});
  scene.box(8, {12.0, 0.0});
  scene.see(3.0);
  scene.scan(3.0);
  const Map map = scene.map();
  ASSERT_EQ(map.features.size(), 2U);
  ASSERT_TRUE(map.features[0].last_absent_ns);
  EXPECT_LT(*map.features[0].last_absent_ns, map.features[0].first_seen_ns);
  EXPECT_LT(seconds_between(*map.features[0].last_absent_ns, map.features[0].first_seen_ns), 0.6);
  EXPECT_FALSE(map.features[1].last_absent_ns) << "no beam went there before";

  // It is still the same thing when it parks, and what is older than that was there.
  scene.chain(3, sides_at(5.0, 0.0));
  scene.scan(12.0);
  EXPECT_EQ(scene.features(), Features({"1 polyline", "2 box"}));
  EXPECT_EQ(scene.map().features[0].last_absent_ns, map.features[0].last_absent_ns);
}

TEST(SemanticMap, AChainThatIsDetectedLaterKeepsItsId) {
  Scene scene;
  scene.chain(3, sides_at(5.0, 0.0));
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  scene.box(7, {5.0, 0.0});
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 box"}));
  scene.lose(7);
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  EXPECT_TRUE(scene.gone().empty());
}

// Where an object is nothing but a part of a wall.
TEST(SemanticMap, AnObjectOnALargerChainIsPartOfIt) {
  Scene scene;
  scene.chain(3, {{0.0, -0.9}, {20.0, -0.9}});
  scene.scan();
  scene.box(7, {5.0, 0.0});
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
}

TEST(SemanticMap, ACarKeepsItsIdWhileItParksIsWalledInAndLeaves) {
  for (const bool is_lost : {false, true}) {
    Scene scene;
    for (double x = 0.0; x < 5.0; x += 0.5) {
      scene.box(7, {x, 0.0}).p_moving = 1.0;
      scene.scan();
    }
    EXPECT_EQ(scene.features(), Features({"1 box"}));
    scene.box(7, {5.0, 0.0}).p_moving = 0.0;
    scene.scan(1.0);
    scene.chain(3, sides_at(5.0, 0.0));
    scene.scan(12.0);
    EXPECT_EQ(scene.features(), Features({"1 polyline"}));
    // Another one parks beside it, and both are one chain, under the older id.
    scene.chain(3, {{3.0, 0.9}, {3.0, -0.9}, {7.0, -0.9}, {12.0, -0.9}});
    scene.scan(1.0);
    EXPECT_EQ(scene.features(), Features({"1 polyline"}));
    EXPECT_TRUE(scene.gone().empty());
    if (is_lost) {
      scene.lose(7);
      scene.scan(1.0);
    }
    const std::uint64_t handle = is_lost ? 8 : 7;
    for (double x = 5.0; x > 0.0; x -= 0.5) {
      scene.box(handle, {x, 0.0}).p_moving = 1.0;
      if (x < 4.0) scene.chain(3, {{7.0, -0.9}, {12.0, -0.9}});
      scene.scan();
    }
    EXPECT_EQ(scene.features(), Features({"1 box", "2 polyline"}));
  }
}

TEST(SemanticMap, ACarThatIsLostWhileItIsWalledInIsTheSameWhenItIsSeenAgain) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.chain(3, {{3.0, 0.9}, {3.0, -0.9}, {7.0, -0.9}, {12.0, -0.9}});
  scene.scan(12.0);
  for (std::uint64_t handle = 8; handle < 10; ++handle) {
    scene.lose(handle - 1);
    scene.scan(1.0);
    scene.box(handle, {5.0, 0.0});
    scene.scan(1.0);
    EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  }
  scene.box(9, {4.5, 0.0}).p_moving = 1.0;
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 box", "3 polyline"}));
  // Another one that comes by while it is still there.
  scene.box(10, {5.1, 0.0}).p_moving = 1.0;
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 box", "3 polyline", "4 box"}));
}

TEST(SemanticMap, ACarThatDrivesOffFromARowIsThere) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.chain(3, sides_at(5.0, 0.0));
  scene.scan(12.0);
  scene.chain(4, {{7.3, -0.9}, {14.0, -0.9}});
  scene.scan(1.0);
  // Its chain becomes a part of another one.
  scene.drop(3);
  scene.chain(4, {{3.0, -0.9}, {14.0, -0.9}});
  scene.scan(1.0);
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  scene.box(7, {5.0, -3.0}).p_moving = 1.0;
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 box", "3 polyline"}));
}

TEST(SemanticMap, TwoThingsAtAChainHaveTwoIds) {
  Scene scene;
  scene.chain(3, {{4.8, 0.0}, {5.2, 0.0}});
  scene.scan();
  scene.box(7, {5.0, 0.2}, 0.3, 0.3);
  scene.box(8, {5.0, -0.2}, 0.3, 0.3);
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 box", "2 box"}));
  scene.lose(7);
  scene.scan();
  EXPECT_EQ(scene.features().size(), 1U);
}

// The end of a car that stands along a wall is not what the wall shows.
TEST(SemanticMap, WhatStandsFreeBesideAPartOfAWallIsShown) {
  Scene scene;
  scene.chain(3, {{0.0, -1.0}, {20.0, -1.0}});
  scene.box(7, {5.0, 0.0}).p_moving = 1.0;
  scene.scan();
  scene.box(7, {5.0, 0.0}).p_moving = 0.0;
  scene.chain(4, {{3.0, 0.9}, {3.0, -0.5}});
  scene.scan(12.0);
  EXPECT_EQ(scene.features().size(), 2U);
}

TEST(SemanticMap, WhoDrivesByAfterAChainHasShrunkIsAnother) {
  for (const double begin_m : {6.9, 8.0}) {
    Scene scene;
    scene.box(7, {5.0, 0.0});
    scene.chain(3, {{3.0, -0.9}, {20.0, -0.9}});
    scene.scan(12.0);
    scene.lose(7);
    scene.scan();
    scene.chain(3, {{begin_m, -0.9}, {20.0, -0.9}});
    scene.scan(60.0);
    scene.box(8, {5.0, 0.0}).p_moving = 1.0;
    scene.scan();
    EXPECT_EQ(scene.features(), Features({"1 polyline", "3 box"}));
  }
}

TEST(SemanticMap, ACarThatIsLostBeforeItIsWalledInIsTheSameWhenItLeaves) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.chain(3, sides_at(5.0, 0.0));
  scene.scan(12.0);
  scene.lose(7);
  scene.scan(1.0);
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  // Others park on both sides, and all are one chain.
  scene.chain(3, {{-3.0, -0.9}, {3.0, -0.9}, {7.0, -0.9}, {13.0, -0.9}});
  scene.scan(30.0);
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  scene.box(8, {5.0, 0.0});
  scene.scan(1.0);
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  scene.box(8, {5.0, -2.0}).p_moving = 1.0;
  scene.chain(3, {{-3.0, -0.9}, {3.0, -0.9}});
  scene.scan(1.0);
  EXPECT_EQ(scene.features(), Features({"1 box", "2 polyline"}));
}

TEST(SemanticMap, WhoStandsAtAWallForAMomentIsNoPartOfIt) {
  Scene scene;
  scene.box(7, {0.0, 5.0}, 0.25, 0.2).p_moving = 1.0;
  scene.scan();
  scene.chain(3, {{0.0, -0.2}, {20.0, -0.2}});
  scene.scan(6.0);
  scene.box(7, {5.0, 0.0}).p_moving = 0.0;
  scene.scan(3.0);
  EXPECT_EQ(scene.features(), Features({"1 box", "2 polyline"}));
  scene.scan(9.0);
  EXPECT_EQ(scene.features(), Features({"2 polyline"}));
}

TEST(SemanticMap, WhoDrivesPastLaterIsNotWhoParkedThere) {
  for (const double later_s : {1.0, 20.0}) {
    Scene scene;
    scene.box(7, {5.0, 0.0});
    scene.chain(3, {{3.0, 0.9}, {3.0, -0.9}, {7.0, -0.9}, {12.0, -0.9}});
    scene.scan(12.0);
    ASSERT_EQ(scene.features(), Features({"1 polyline"}));
    scene.lose(7);
    scene.scan();
    scene.chain(3, {{7.0, -0.9}, {12.0, -0.9}});
    scene.scan(later_s);
    scene.box(8, {5.0, 0.0}).p_moving = 1.0;
    scene.scan();
    EXPECT_EQ(scene.features(), later_s < 5.0 ? Features({"1 box", "3 polyline"}) : Features({"1 polyline", "3 box"}));
  }
}

// The chain that shows an object may be another one from scan to scan.
TEST(SemanticMap, EachChainOfAParkedThingIsShown) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.chain(3, {{3.0, -0.9}, {4.9, -0.9}});
  scene.chain(4, {{5.1, -0.9}, {7.0, -0.9}});
  scene.scan(12.0);
  EXPECT_EQ(scene.features(), Features({"1 polyline", "2 polyline"}));
  scene.chain(3, {{3.0, -0.9}, {4.0, -0.9}});
  scene.scan();
  EXPECT_EQ(scene.features().size(), 2U);
  scene.chain(3, {{3.0, -0.9}, {5.0, -0.9}});
  scene.scan();
  EXPECT_EQ(scene.features().size(), 2U);
}

// Noise drew a wall twice.
TEST(SemanticMap, ASurfaceIsThereOnce) {
  Scene scene;
  scene.chain(3, {{0.0, 0.0}, {10.0, 0.0}});
  scene.chain(4, {{4.0, 0.05}, {6.0, 0.05}});
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  // One that goes on beside the end shows what is beyond.
  scene.chain(4, {{8.0, 0.05}, {14.0, 0.05}});
  scene.scan();
  ASSERT_EQ(scene.features(), Features({"1 polyline", "2 polyline"}));
  const auto part = std::get<PolylineShape>(scene.map().features[1].shape).vertices;
  ASSERT_EQ(part.size(), 2U);
  EXPECT_NEAR(part.front().p_world_m.x(), 10.0, 0.06);
  EXPECT_NEAR(part.back().p_world_m.x(), 14.0, 1e-9);
  // The back of a thin wall is another surface.
  scene.chain(5, {{6.0, 0.08}, {4.0, 0.08}});
  scene.scan();
  EXPECT_EQ(scene.features().size(), 3U);
  // The wall goes, and what was beside it is what is there.
  scene.chain(4, {{4.0, 0.05}, {6.0, 0.05}});
  scene.scan();
  EXPECT_EQ(scene.features().size(), 2U);
  scene.drop(3);
  scene.scan(0.2);
  EXPECT_EQ(scene.features().size(), 2U);
}

TEST(SemanticMap, ASurfaceIsThereOnceWhereverItIs) {
  for (const double y_m : {3.0, 3.98, -0.02}) {
    Scene scene;
    scene.chain(3, {{0.0, y_m}, {10.0, y_m}});
    scene.chain(4, {{4.0, y_m + 0.05}, {6.0, y_m + 0.05}});
    scene.scan();
    EXPECT_EQ(scene.features(), Features({"1 polyline"})) << y_m;
  }
}

// What showed a surface is itself shown by another chain now.
TEST(SemanticMap, NoSurfaceIsHiddenByOneThatIsNotShown) {
  Scene scene;
  scene.chain(3, {{28.0, 0.0}, {60.0, 0.0}});
  scene.chain(4, {{0.0, 0.05}, {30.0, 0.05}});
  scene.chain(5, {{2.0, 0.0}, {6.0, 0.0}});
  scene.scan();
  EXPECT_EQ(scene.features().size(), 2U);
  scene.chain(3, {{0.2, 0.0}, {60.0, 0.0}});
  scene.scan();
  EXPECT_EQ(scene.features().size(), 1U);
  // Metres that no other one is beside are shown.
  scene.chain(3, {{11.0, 0.0}, {60.0, 0.0}});
  scene.scan();
  double least_m = 60.0;
  for (const Feature& feature : scene.map().features) {
    least_m = std::min(least_m, std::get<PolylineShape>(feature.shape).vertices.front().p_world_m.x());
  }
  EXPECT_EQ(least_m, 0.0);
}

TEST(SemanticMap, WhoStandsForAMomentIsNoChain) {
  Scene scene;
  Object& walker = scene.box(7, {5.0, 0.0}, 0.25, 0.2);
  walker.object_class = ObjectClass::kPerson;
  walker.p_moving = 1.0;
  scene.scan();
  scene.box(7, {5.0, 0.0}).p_moving = 0.0;
  scene.chain(3, {{4.75, -0.2}, {5.25, -0.2}});
  scene.scan(3.0);
  EXPECT_EQ(scene.features(), Features({"1 box"}));
  scene.scan(27.0);
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  scene.box(7, {5.5, 0.0}).p_moving = 1.0;
  scene.scan();
  scene.drop(3);
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 box"}));
}

TEST(SemanticMap, OfTwoChainsThatMeetTheOlderIdStays) {
  for (const bool older_goes : {false, true}) {
    Scene scene;
    scene.chain(3, {{0.0, 0.0}, {5.0, 0.0}});
    scene.scan();
    scene.chain(4, {{6.0, 0.0}, {10.0, 0.0}});
    scene.scan();
    scene.chain(older_goes ? 4 : 3, {{0.0, 0.0}, {10.0, 0.0}});
    scene.drop(older_goes ? 3 : 4);
    scene.scan();
    EXPECT_EQ(scene.features(), Features({"1 polyline"}));
    ASSERT_EQ(scene.gone().size(), 1U);
    EXPECT_EQ(scene.gone()[0].id, 2U);
    EXPECT_EQ(scene.gone()[0].into, FeatureId{1});
  }
}

/// Corners of a polygon around a round thing.
std::vector<Eigen::Vector2d> around(const Eigen::Vector2d& center_m, double radius_m, double from_rad, double to_rad,
                                    int n) {
  std::vector<Eigen::Vector2d> points_m;
  for (int k = 0; k < n; ++k) {
    const double angle_rad = from_rad + (to_rad - from_rad) * k / (n - 1);
    points_m.emplace_back(center_m + radius_m * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad)));
  }
  return points_m;
}

TEST(SemanticMap, AChainAroundABuildingBecomesABoundaryUnderOneId) {
  Scene scene;
  const Eigen::Vector2d middle(0.0, 20.0);
  scene.chain(3, around(middle, 5.0, 0.0, -3.0, 15));
  scene.boundary(3, middle, 5.0, {3});
  scene.scan(0.5);
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  scene.scan(1.0);
  EXPECT_EQ(scene.features(), Features({"1 boundary"}));
  // The other side, which the boundary is not drawn along yet, is another chain until the corner is seen.
  scene.chain(4, around(middle, 5.3, 3.0, 0.5, 15));
  scene.scan(0.5);
  EXPECT_EQ(scene.features(), Features({"1 boundary", "2 polyline"}));
  scene.boundary(3, middle, 5.0, {3, 4});
  scene.scan(0.5);
  EXPECT_EQ(scene.features(), Features({"1 boundary"}));
  ASSERT_EQ(scene.gone().size(), 1U);
  EXPECT_EQ(scene.gone()[0].id, 2U);
  EXPECT_EQ(scene.gone()[0].reason, GoneReason::kMerged);
  EXPECT_EQ(scene.gone()[0].into, FeatureId{1});
  // The chain that it began with is the smaller part of it at last, and goes.
  scene.drop(3);
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 boundary"}));
  // It splits.
  scene.leave_boundary(3);
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  EXPECT_EQ(scene.gone().size(), 1U);
}

// Where a boundary is drawn farther than its chains go, another chain there is the same surface.
TEST(SemanticMap, WhatABoundaryIsDrawnAlongIsNotThereTwice) {
  Scene scene;
  const Eigen::Vector2d middle(0.0, 20.0);
  scene.chain(3, around(middle, 5.0, 0.0, -3.0, 15));
  scene.boundary(3, middle, 5.0, {3});
  scene.scan(2.0);
  scene.chain(4, around(middle, 5.03, 3.0, 0.5, 15));
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 boundary"}));
  scene.leave_chain(3);
  scene.leave_boundary(3);
  scene.scan(0.5);
  EXPECT_EQ(scene.features(), Features({"1 polyline", "2 polyline"}));
}

TEST(SemanticMap, AnObjectOnTheChainOfAnotherOneIsPartOfIt) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.chain(3, sides_at(5.0, 0.0));
  scene.scan(12.0);
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  scene.box(8, {5.0, -0.9}, 1.5, 0.05);
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
}

TEST(SemanticMap, AnObjectThatItsLayerFindsAgainKeepsItsId) {
  Scene scene;
  scene.box(7, {5.0, 0.0}).p_moving = 1.0;
  scene.scan();
  scene.lose(7);
  scene.scan(2.0);
  EXPECT_TRUE(scene.features().empty());
  ASSERT_EQ(scene.gone().size(), 1U);
  EXPECT_EQ(scene.gone()[0].reason, GoneReason::kLeft);
  scene.box(8, {9.0, 5.0});
  scene.box(7, {7.0, 0.0});
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 box", "2 box"}));
}

// A walker whom a layer does not list for a moment was not away.
TEST(SemanticMap, WhatIsNotListedForAMomentGoesOn) {
  Scene scene;
  Object& walker = scene.box(7, {5.0, 0.0}, 0.25, 0.2);
  walker.p_moving = 1.0;
  walker.velocity_world_m_s = {1.0, 0.0};
  scene.scan();
  scene.lose(7);
  scene.scan(0.5);
  ASSERT_EQ(scene.features(), Features({"1 box"}));
  EXPECT_NEAR(std::get<BoxShape>(scene.map().features[0].shape).box_world.center_m.x(), 5.5, 1e-6);
  EXPECT_TRUE(scene.gone().empty());
  scene.box(7, {5.6, 0.0}, 0.25, 0.2).p_moving = 1.0;
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 box"}));
}

// What its layer takes for a part of a parked car, and then for another part of it, is the car.
TEST(SemanticMap, AParkedCarKeepsItsIdWhateverOfItIsDetected) {
  Scene scene;
  scene.chain(3, sides_at(5.0, 0.0));
  scene.scan(20.0);
  ASSERT_EQ(scene.features(), Features({"1 polyline"}));
  scene.box(7, {3.3, 0.3}, 0.3, 0.3);
  scene.scan(0.5);
  for (const double half_length_m : {0.8, 2.0, 0.5, 2.0}) {
    Object& box = scene.box(7, {3.0 + half_length_m, 0.0});
    box.box_world.half_length_m = half_length_m;
    box.box_world.half_width_m = 0.9;
    scene.scan(0.5);
    EXPECT_EQ(scene.features().front(), "1 polyline");
  }
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  scene.box(7, {4.5, -2.0}).p_moving = 1.0;
  scene.scan();
  EXPECT_EQ(scene.features().front(), "1 box");
}

// Of a car whose ends are seen first its layer makes something in between.
TEST(SemanticMap, WhatIsDetectedInsideAThingIsPartOfIt) {
  Scene scene;
  scene.chain(3, {{7.0, -0.9}, {3.0, -0.9}, {3.0, 0.9}});  // its free side to the left
  scene.box(7, {4.5, 0.0}, 0.5, 0.5);
  scene.box(8, {4.0, -1.6}, 0.5, 0.5);
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 polyline", "2 box"}));
}

// A car that comes from afar is drawn before it is followed.
TEST(SemanticMap, WhatWasDrawnBeforeItWasFollowedIsNone) {
  Scene scene;
  scene.chain(3, {{0.0, -0.9}, {2.0, -0.9}});
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  scene.scan(1.5);
  Object& car = scene.box(7, {5.0, 0.0});
  car.p_moving = 1.0;
  car.velocity_world_m_s = {2.0, 0.0};
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"2 box"}));
}

// The side of a car that nobody sees any more, once it has driven off, is not left behind.
TEST(SemanticMap, WhatDrivesOffLeavesNothingBehind) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.chain(3, sides_at(5.0, 0.0));
  scene.scan(12.0);
  scene.box(7, {5.0, -9.0}).p_moving = 1.0;
  scene.chain(3, {{3.0, 0.9}, {3.0, -0.9}});
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 box"}));
  // Something is hit there, and that is something else.
  scene.scan(3.0);
  scene.chain(3, {{3.0, 0.9}, {3.0, -0.9}});
  scene.scan();
  EXPECT_EQ(scene.features().size(), 2U);
}

TEST(SemanticMap, WhatWasDrawnOfAWalkerIsNone) {
  Scene scene;
  scene.box(7, {5.0, 0.0}, 0.25, 0.2).p_moving = 1.0;
  scene.scan();
  scene.chain(3, {{4.8, -0.2}, {5.0, -0.2}});
  scene.scan();
  for (double x = 5.1; x < 7.0; x += 0.1) {
    scene.box(7, {x, 0.0}, 0.25, 0.2).p_moving = 1.0;
    scene.scan();
    EXPECT_EQ(scene.features(), Features({"1 box"})) << x;
  }
}

// Of a pole noise draws a second piece.
TEST(SemanticMap, APieceBesideAPoleIsNone) {
  Scene scene;
  scene.chain(3, {{4.9, 0.1}, {4.9, -0.1}, {5.1, -0.1}, {5.1, 0.1}});
  scene.chain(4, {{5.0, 0.0}, {5.1, 0.05}});
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
}

// A walker who stands at a pole hides it, but is not the pole, which stays what it was.
TEST(SemanticMap, WhatWasThereBeforeKeepsItsId) {
  Scene scene;
  scene.box(7, {0.0, 5.0}, 0.25, 0.2).p_moving = 1.0;
  scene.scan();
  scene.chain(3, {{4.85, -0.1}, {5.15, -0.1}});
  scene.scan(6.0);
  scene.box(7, {5.0, 0.0}).p_moving = 0.0;
  scene.scan(3.0);
  EXPECT_EQ(scene.features(), Features({"1 box"}));
  scene.scan(9.0);
  EXPECT_EQ(scene.features(), Features({"2 polyline"}));
  scene.box(7, {7.0, 0.0}).p_moving = 1.0;
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 box", "2 polyline"}));
}

// What stood is seen through if beams pass where it was, and else not seen any more.
// Its layer knows it from the transit before.
TEST(SemanticMap, WhatStoodBeforeThePresentTransitIsFixed) {
  Scene scene;
  scene.chain(3, {{0.0, 9.0}, {20.0, 9.0}});
  scene.scan();
  EXPECT_EQ(scene.map().features.at(0).motion, Motion::kStanding);
  scene.chain(3, {{0.0, 9.0}, {20.0, 9.0}}, ChainState::kWall);
  scene.scan();
  EXPECT_EQ(scene.map().features.at(0).motion, Motion::kFixed);
}

TEST(SemanticMap, TellsWhatIsNotThereFromWhatIsNotSeen) {
  for (const bool passes : {true, false}) {
    Scene scene;
    scene.see(3.0);
    scene.box(7, {5.0, 0.0});
    scene.scan(1.0);
    scene.see(passes ? 9.0 : 3.0);
    scene.lose(7);
    scene.scan(2.0);
    ASSERT_EQ(scene.gone().size(), 1U);
    EXPECT_EQ(scene.gone()[0].reason, passes ? GoneReason::kSeenThrough : GoneReason::kLeft);
  }
}

// It went between the time when it was seen last and that when its place was seen to be free.
TEST(SemanticMap, TellsWhenAThingWasNotThereAnyMoreBeforeItIsGone) {
  for (const bool is_chain : {true, false}) {
    Scene scene;
    scene.see(3.0);
    if (is_chain) {
      scene.chain(3, {{5.0, -0.4}, {5.0, 0.4}});
    } else {
      scene.box(7, {5.0, 0.0}, 0.5, 0.5);
    }
    scene.scan(2.0);
    const std::int64_t last_seen_ns = scene.map().features.at(0).last_seen_ns;
    scene.see(9.0);
    const std::int64_t free_from_ns = scene.stamp_ns();
    if (!is_chain) scene.lose(7);
    scene.scan();
    if (is_chain) {
      scene.scan(0.9);
      scene.drop(3);
    }
    while (scene.gone().empty() && scene.stamp_ns() < free_from_ns + 3'000'000'000) {
      EXPECT_EQ(scene.features().size(), 1U);
      scene.scan();
    }
    EXPECT_TRUE(scene.features().empty());
    ASSERT_EQ(scene.gone().size(), 1U);
    EXPECT_EQ(scene.gone()[0].reason, GoneReason::kSeenThrough);
    const Feature& last = scene.last(1);
    EXPECT_EQ(last.last_seen_ns, last_seen_ns);
    ASSERT_TRUE(last.first_absent_ns);
    EXPECT_GT(*last.first_absent_ns, free_from_ns);
    EXPECT_LE(*last.first_absent_ns, free_from_ns + 600'000'000) << "a scan in .5 s is remembered";
  }
}

TEST(SemanticMap, AChainHardlyLargerThanAnObjectIsIt) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.scan();
  scene.chain(3, {{2.0, -0.9}, {6.4, -0.9}});
  scene.scan(12.0);
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  EXPECT_TRUE(scene.gone().empty());
}

// Of a box of which one side is seen the length may be anything.
TEST(SemanticMap, AnObjectStaysItsChainWhileItsBoxShrinksAndGrows) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.chain(3, sides_at(5.0, 0.0));
  scene.scan(12.0);
  for (const double half_length_m : {0.6, 2.0, 0.9, 1.4, 2.0}) {
    scene.box(7, {5.0, 0.0}).box_world.half_length_m = half_length_m;
    scene.scan(0.3);
    EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  }
  EXPECT_TRUE(scene.gone().empty());
}

TEST(SemanticMap, TheOtherSidesOfWhatIsOneAgainAreMergedIntoIt) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.chain(3, {{3.0, -0.9}, {7.0, -0.9}});
  scene.chain(4, {{3.0, 0.9}, {3.0, -0.7}});
  scene.scan(12.0);
  EXPECT_EQ(scene.features(), Features({"1 polyline", "2 polyline"}));
  scene.box(7, {5.0, 0.0}).p_moving = 1.0;
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 box"}));
  ASSERT_EQ(scene.gone().size(), 1U);
  EXPECT_EQ(scene.gone()[0].reason, GoneReason::kMerged);
  EXPECT_EQ(scene.gone()[0].into, FeatureId{1});
}

TEST(SemanticMap, TheEndOfALongerChainBesideTheMiddleOfAShorterOneIsLeftOut) {
  Scene scene;
  scene.chain(3, {{0.0, 0.0}, {10.0, 0.0}});
  scene.chain(4, {{9.0, 1.5}, {9.7, 0.05}, {10.5, 0.05}, {12.0, 2.0}});
  scene.scan();
  const Map map = scene.map();
  ASSERT_EQ(map.features.size(), 2U);
  const auto& longer = std::get<PolylineShape>(map.features[0].shape).vertices;
  EXPECT_EQ(longer.front().p_world_m, Eigen::Vector2d::Zero());
  EXPECT_NEAR(longer.back().p_world_m.x(), 9.72, 0.06);
  EXPECT_EQ(std::get<PolylineShape>(map.features[1].shape).vertices.size(), 4U);
}

TEST(SemanticMap, ABoundaryStaysWhileItsChainsComeAndGo) {
  const std::vector<Eigen::Vector2d> first = around({0.0, 20.0}, 5.0, 0.0, -4.0, 20),
                                     second = around({0.0, 20.0}, 5.0, 2.2, 0.5, 15);
  Scene scene;
  scene.chain(3, first);
  scene.chain(4, second);
  scene.boundary(3, {0.0, 20.0}, 5.0, {3, 4});
  scene.scan(2.0);
  ASSERT_EQ(scene.features(), Features({"1 boundary"}));
  // The longer one leaves it.
  scene.leave_chain(3);
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"1 polyline", "2 boundary"}));
  // The chain that it has its id of is not on the map yet, and goes.
  Scene other;
  other.box(7, {5.0, 20.0}, 6.0, 6.0).p_moving = 1.0;
  other.chain(3, first);
  other.boundary(3, {0.0, 20.0}, 5.0, {3, 4});
  other.scan(2.0);
  other.chain(4, second);
  other.scan();
  other.drop(3);
  other.lose(7);
  other.scan();
  other.box(8, {3.5, 23.5}, 0.5, 0.5);
  other.scan(1.0);
  ASSERT_EQ(other.features().size(), 1U);
  EXPECT_EQ(other.features()[0].substr(2), "boundary");
}

// Of four walls arcs explain nothing that their corners do not.
TEST(SemanticMap, ARoomStaysAChain) {
  Scene scene;
  scene.chain(3, {{0.0, 0.0}, {0.0, 6.0}, {8.0, 6.0}, {8.0, 0.0}, {0.1, 0.0}});
  scene.boundary(3, {4.0, 3.0}, 4.0, {3});
  scene.scan(5.0);
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
}

TEST(SemanticMap, ACarThatACameraAndALaserSeeIsOne) {
  for (const bool camera_first : {false, true}) {
    Scene scene;
    if (camera_first) {
      scene.scan();
      scene.target(9, {5.2, 0.4});
      scene.image();
      EXPECT_EQ(scene.features(), Features({"1 target"}));
    }
    // A laser sees one side of it, half a car beside its middle.
    scene.chain(3, {{3.0, -0.9}, {7.0, -0.9}});
    scene.scan();
    for (int i = 0; i < 3; ++i) {
      scene.target(9, {5.2, 0.1});
      scene.image();
      scene.scan();
    }
    EXPECT_EQ(scene.features(), Features({"1 polyline"}));
    const Feature feature = scene.map().features.front();
    EXPECT_TRUE(feature.seen_by.scan && feature.seen_by.camera);
    EXPECT_EQ(feature.object_class, ObjectClass::kVehicle);
    EXPECT_NEAR(feature.p_class, 0.8, 1e-12);
    ASSERT_EQ(scene.gone().size(), 1U);
    EXPECT_EQ(scene.gone()[0].into, FeatureId{1});
    // The camera sees it elsewhere: they were two.
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(scene.features(), Features({"1 polyline"}));
      scene.target(9, {5.2, 8.0});
      scene.image();
    }
    EXPECT_EQ(scene.features(), Features({"1 polyline", "3 target"}));
  }
}

TEST(SemanticMap, TwoCarsSideBySideAreTwo) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.box(8, {5.0, 3.0});
  scene.scan();
  for (int i = 0; i < 5; ++i) {
    scene.target(1, {5.3, 0.5});
    scene.target(2, {5.3, 2.4});
    scene.image();
    scene.scan();
  }
  EXPECT_EQ(scene.features(), Features({"1 box", "2 box"}));
  EXPECT_TRUE(scene.map().features[0].seen_by.camera);
  EXPECT_TRUE(scene.map().features[1].seen_by.camera);
}

TEST(SemanticMap, OfTwoTargetsAtACarOneIsIt) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.scan();
  for (int i = 0; i < 5; ++i) {
    scene.target(1, {5.1, 1.5});
    scene.target(2, {5.1, 0.3});
    scene.image();
  }
  EXPECT_EQ(scene.features(), Features({"1 box", "2 target"}));
}

TEST(SemanticMap, AMapThatBeginsAnewGivesNoIdTwice) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.chain(3, {{0.0, 10.0}, {20.0, 10.0}});
  scene.scan();
  const FeatureId upcoming = scene.upcoming();
  scene.begin_anew();
  EXPECT_TRUE(scene.map().features.empty());
  scene.box(8, {5.0, 10.0});
  scene.chain(4, {{0.0, 12.0}, {20.0, 12.0}});
  scene.scan();
  const Map map = scene.map();
  ASSERT_EQ(map.features.size(), 2U);
  EXPECT_GE(map.features.front().id, upcoming);
}

// A chain that takes over an id is what it was before, too.
TEST(SemanticMap, WhatTakesOverAnIdIsToldAsMergedIntoIt) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.chain(3, {{3.0, -0.9}, {6.0, -0.9}});
  scene.scan(12.0);
  scene.chain(4, {{7.0, -0.8}, {7.0, 0.9}});
  scene.scan(0.5);
  EXPECT_EQ(scene.features(), Features({"1 polyline", "2 polyline"}));
  scene.chain(3, {{3.0, -0.9}, {3.5, -0.9}});
  scene.chain(4, {{5.0, -0.9}, {7.0, -0.9}, {7.0, 0.9}});
  scene.scan(0.5);
  for (const Gone& gone : scene.gone()) {
    EXPECT_EQ(gone.reason, GoneReason::kMerged) << gone.id;
    EXPECT_EQ(gone.into, FeatureId{1});
  }
  EXPECT_FALSE(scene.gone().empty());
}

TEST(SemanticMap, WhatGoesSaysWhy) {
  Scene scene;
  scene.box(7, {5.0, 0.0}).p_moving = 1.0;
  scene.chain(3, {{0.0, 10.0}, {20.0, 10.0}});
  scene.scan();
  EXPECT_EQ(scene.features().size(), 2U);
  scene.lose(7);
  scene.drop(3);
  scene.scan(2.0);
  ASSERT_EQ(scene.gone().size(), 2U);
  std::set<GoneReason> reasons = {scene.gone()[0].reason, scene.gone()[1].reason};
  EXPECT_EQ(reasons, std::set<GoneReason>({GoneReason::kLeft, GoneReason::kSeenThrough}));
}

// --- what who drives by the map relies on

/// A wall that has stood for long, which the scans still see.
void stand_for_long(Scene& scene) {
  scene.chain(3, {{0.0, -0.9}, {20.0, -0.9}});
  scene.scan(61.0);
  scene.chain(3, {{0.0, -0.9}, {20.0, -0.9}});
  scene.scan();
  EXPECT_EQ(scene.map().features.at(0).motion, Motion::kFixed);
}

TEST(SemanticMap, WhatHasJustComeToAnOldWallIsNotTheWall) {
  Scene scene;
  stand_for_long(scene);
  scene.box(7, {5.0, -0.5}, 0.3, 0.3);
  scene.scan(1.9);
  EXPECT_EQ(scene.features(), Features({"1 polyline", "2 box"}));
  scene.scan(0.5);
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
  scene.scan(10.0);
  EXPECT_EQ(scene.features(), Features({"1 polyline"}));
}

TEST(SemanticMap, APersonIsNeverAPartOfAWall) {
  for (const bool has_walked : {true, false}) {
    Scene scene;
    stand_for_long(scene);
    for (double x_m = 3.0; x_m < 5.0 && has_walked; x_m += 0.1) {
      scene.box(7, {x_m, -0.6}, 0.3, 0.3).p_moving = 1.0;
      scene.scan();
    }
    Object& person = scene.box(7, {5.0, -0.6}, 0.3, 0.3);
    person.p_moving = 0.0;
    person.object_class = ObjectClass::kPerson;
    person.p_class = 0.9;
    scene.scan(30.0);
    ASSERT_EQ(scene.features(), Features({"1 polyline", "2 box"}));
    EXPECT_EQ(scene.map().features[1].object_class, ObjectClass::kPerson);
  }
}

TEST(SemanticMap, AChainIsFixedByItsOwnAge) {
  Scene scene;
  scene.box(7, {5.0, 0.0});
  scene.scan(100.0);
  scene.chain(3, sides_at(5.0, 0.0));
  scene.scan(10.0);
  scene.chain(3, sides_at(5.0, 0.0));
  scene.scan();
  ASSERT_EQ(scene.features(), Features({"1 polyline"}));
  EXPECT_EQ(scene.map().features[0].motion, Motion::kStanding);
  scene.scan(60.0);
  scene.chain(3, sides_at(5.0, 0.0));
  scene.scan();
  EXPECT_EQ(scene.map().features[0].motion, Motion::kFixed);
}

TEST(SemanticMap, ABoundaryIsAsCertainAsTheLeastOfItsChains) {
  Scene scene;
  scene.chain(3, around({0.0, 20.0}, 5.0, 0.0, -4.0, 20));
  scene.chain(4, around({0.0, 20.0}, 5.0, 2.2, 0.5, 15));
  scene.boundary(3, {0.0, 20.0}, 5.0, {3, 4});
  scene.scan(2.0);
  ASSERT_EQ(scene.features(), Features({"1 boundary"}));
  EXPECT_EQ(scene.map().features[0].p_exists, 0.99);
  scene.doubt(4);
  scene.scan();
  EXPECT_EQ(scene.map().features[0].p_exists, 0.4);
  // It leaves, and what is left is certain again.
  scene.leave_chain(4);
  scene.scan();
  EXPECT_EQ(scene.map().features[0].p_exists, 0.99);
}

TEST(SemanticMap, TellsByWhichScanItsObjectsAreKnown) {
  Scene scene;
  EXPECT_EQ(scene.map().objects_stamp_ns, 0);
  scene.with_objects = false;
  scene.scan();
  EXPECT_EQ(scene.map().objects_stamp_ns, 0);
  scene.with_objects = true;
  scene.scan();
  EXPECT_EQ(scene.map().objects_stamp_ns, scene.stamp_ns()) << "that there are none is known, too";
  scene.box(7, {5.0, 0.0}).beams = 20;
  scene.scan();
  const std::int64_t seen_ns = scene.stamp_ns();
  EXPECT_EQ(scene.map().objects_stamp_ns, seen_ns);
  scene.objects_go_on = false;
  scene.scan(3.0);
  EXPECT_EQ(scene.map().objects_stamp_ns, seen_ns);
  scene.objects_go_on = true;
  scene.scan();
  scene.with_objects = false;
  const std::int64_t latest_ns = scene.stamp_ns();
  scene.image();
  scene.scan();
  EXPECT_EQ(scene.map().objects_stamp_ns, latest_ns);
  EXPECT_EQ(scene.map().stamp_ns, scene.stamp_ns());
}

/// A standing feature of another program's map.
Feature saved_feature(FeatureId id, const FeatureShape& shape) {
  Feature feature;
  feature.id = id;
  feature.motion = Motion::kStanding;
  feature.first_seen_ns = 900'000'000'000;
  feature.last_seen_ns = 990'000'000'000;
  feature.seen_by.scan = true;
  feature.shape = shape;
  return feature;
}

Map saved_map(const std::vector<Feature>& features) {
  Map map;
  map.stamp_ns = 1'000'000'000'000;
  map.features = features;
  return map;
}

TEST(SemanticMap, WhatALayerSeesWhereAFileHasAThingIsThat) {
  Scene scene;
  Feature car = saved_feature(7, BoxShape{{{3.0, 2.0}, 0.0, 2.0, 0.9}, {}});
  car.object_class = ObjectClass::kVehicle;
  car.p_class = 0.8;
  scene.resume(saved_map({car, saved_feature(8, BoxShape{{{30.0, 2.0}, 0.0, 2.0, 0.9}, {}})}), {});
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"7 box", "8 box"}));
  EXPECT_EQ(scene.last(7).object_class, ObjectClass::kVehicle);
  EXPECT_TRUE(scene.last(7).seen_by.file);
  scene.box(5, {3.1, 2.1});
  scene.scan(2.0);
  EXPECT_EQ(scene.features(), Features({"7 box", "8 box"}));
  EXPECT_FALSE(scene.last(7).seen_by.file) << "its layer has it now";
  EXPECT_NEAR(std::get<BoxShape>(scene.last(7).shape).box_world.center_m.x(), 3.1, 1e-9);
  scene.box(6, {-3.0, 2.0});
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"7 box", "8 box", "1000 box"}));
  EXPECT_TRUE(scene.gone().empty());
}

TEST(SemanticMap, AChainWhereAFileHasAThingIsThat) {
  Scene scene;
  scene.with_objects = false;
  scene.resume(saved_map({saved_feature(7, BoxShape{{{3.0, 2.0}, 0.0, 2.0, 0.9}, {}}),
                          saved_feature(8, EllipseShape{{{0.0, 5.1}, 0.0, 0.2, 0.2}, {}})}),
               {});
  scene.chain(4, {{5.0, 1.1}, {1.0, 1.1}});
  scene.chain(5, {{9.0, 5.0}, {-9.0, 5.0}});
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"7 polyline", "1000 polyline"}));
  ASSERT_EQ(scene.gone().size(), 0U) << "the ellipse was not told before";
}

TEST(SemanticMap, WhatAFileHasBesideAWallOfItStays) {
  Scene scene;
  const Feature wall = saved_feature(7, PolylineShape{{{{5.0, 1.0}, 0.01}, {{-5.0, 1.0}, 0.01}}, false});
  const Feature crate = saved_feature(8, BoxShape{{{0.0, 0.55}, 0.0, 0.4, 0.4}, {}});
  scene.with_objects = false;
  scene.resume(saved_map({wall, crate}), {{7, 3, false}});
  for (const double end_m : {-5.0, -5.1, -5.2}) {
    scene.chain(3, {{5.0, 1.0}, {end_m, 1.0}});
    scene.scan();
    EXPECT_EQ(scene.features(), Features({"7 polyline", "8 box"}));
  }
}

TEST(SemanticMap, AChainOfAFileKeepsWhatTheFileSays) {
  Scene scene;
  Feature wall = saved_feature(7, PolylineShape{{{{5.0, 1.0}, 0.01}, {{1.0, 1.0}, 0.01}}, false});
  wall.motion = Motion::kFixed;
  wall.last_seen_ns = wall.first_seen_ns;
  wall.last_absent_ns = 800'000'000'000;
  Feature car = saved_feature(8, PolylineShape{{{{5.0, -1.0}, 0.01}, {{1.0, -1.0}, 0.01}}, false});
  car.object_class = ObjectClass::kVehicle;
  car.p_class = 0.8;
  scene.resume(saved_map({wall, car}), {{7, 3, false}, {8, 4, false}});
  scene.chain(3, {{5.0, 1.0}, {1.0, 1.0}});
  scene.chain(4, {{5.0, -1.0}, {1.0, -1.0}});
  scene.scan(70.0);
  scene.chain(4, {{5.0, -1.0}, {1.0, -1.0}});
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"7 polyline", "8 polyline"}));
  EXPECT_EQ(scene.last(7).motion, Motion::kFixed);
  EXPECT_EQ(scene.last(7).last_absent_ns, wall.last_absent_ns);
  EXPECT_EQ(scene.last(8).motion, Motion::kStanding) << "it had moved";
  EXPECT_EQ(scene.last(8).object_class, ObjectClass::kVehicle);
}

TEST(SemanticMap, WhatBeamsPassThatAFileHasIsGone) {
  Scene scene;
  std::vector<Feature> features;
  for (FeatureId id = 1; id <= 40; ++id) {
    const double angle_rad = 0.15 * static_cast<double>(id);
    const Eigen::Vector2d at_m = (id == 9 ? 3.0 : 8.0) * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad));
    features.push_back(saved_feature(id, EllipseShape{{at_m, 0.0, 0.3, 0.3}, {}}));
  }
  scene.resume(saved_map(features), {});
  scene.scan();
  EXPECT_EQ(scene.features().size(), 40U);
  scene.see(5.0);
  scene.scan(3.0);
  ASSERT_EQ(scene.gone().size(), 1U);
  EXPECT_EQ(scene.gone()[0].id, 9U);
  EXPECT_EQ(scene.gone()[0].reason, GoneReason::kSeenThrough);
  EXPECT_TRUE(scene.last(9).first_absent_ns) << "it is told when it was not there any more";
  EXPECT_EQ(scene.features().size(), 39U);
}

TEST(SemanticMap, ABoundaryOfAFileIsOneAtOnce) {
  Scene scene;
  scene.resume(saved_map({saved_feature(7, ArcShape{{}, true})}), {{7, 3, true}});
  std::vector<Eigen::Vector2d> circle;
  for (int k = 0; k < 40; ++k) circle.emplace_back(6.0 * std::cos(-0.157 * k), 6.0 * std::sin(-0.157 * k));
  scene.chain(3, circle);
  scene.boundary(1, {0.0, 0.0}, 6.0, {3});
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"7 boundary"}));
}

TEST(SemanticMap, ATargetOfAFileIsTheOneThatACameraSees) {
  Scene scene;
  scene.resume(saved_map({saved_feature(7, FootprintShape{{3.0, 2.0, 0.0}, 0.04 * Eigen::Matrix2d::Identity(), 7.0})}),
               {});
  scene.scan();
  EXPECT_EQ(scene.features(), Features({"7 target"}));
  scene.target(1, {3.4, 2.2});
  scene.image();
  EXPECT_EQ(scene.features(), Features({"7 target"}));
}

TEST(IdSource, GivesNoneTwice) {
  IdSource ids(5);
  const FeatureId first = ids.next();
  EXPECT_EQ(IdSource::robot_of(first), 5U);
  EXPECT_LT(first, std::uint64_t{1} << 53);
  EXPECT_GT(ids.next(), first);
  const FeatureId saved = ids.upcoming();
  IdSource later(5);
  later.resume(saved);
  EXPECT_EQ(later.next(), saved);
  later.resume(first);
  EXPECT_EQ(later.next(), saved + 1);
  IdSource other(6);
  other.resume(saved);
  EXPECT_EQ(IdSource::robot_of(other.next()), 6U);
  EXPECT_THROW(IdSource(IdSource::kMostRobot + 1), std::invalid_argument);
  IdSource last(0);
  last.resume((FeatureId{1} << IdSource::kCounterBits) - 1);
  EXPECT_THROW(last.next(), std::length_error);
}

}  // namespace
}  // namespace situation_awareness::semantic_map_test
