// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/pending_changes.hpp"

#include <cstdint>
#include <map>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "situation_awareness/map/map_replica.hpp"

namespace situation_awareness::pending_changes_test {
namespace {

using Verdict = MapReplica::Verdict;

/// A map whose features have a state that is told by `p_exists`, and which is begun anew now and then.
class ChangingMap {
 public:
  explicit ChangingMap(unsigned seed) : random_(seed) {}

  MapDelta next() {
    MapDelta delta;
    const bool anew = version_ == 0 || chance(0.05);
    if (anew) {
      ++map_;
      features_.clear();
    }
    delta.full = anew || chance(0.1);
    delta.map = map_;
    delta.base = delta.full ? 0 : version_;
    delta.version = ++version_;
    delta.stamp_ns = static_cast<std::int64_t>(version_);
    if (anew) add_feature(delta);
    change(delta);
    if (delta.full) delta.changed = all();
    return delta;
  }

  std::vector<Feature> all() const {
    std::vector<Feature> result;
    for (const auto& [id, feature] : features_) result.push_back(feature);
    return result;
  }

 private:
  bool chance(double p) { return std::bernoulli_distribution(p)(random_); }
  double number() { return std::uniform_real_distribution<>(0.0, 1.0)(random_); }

  void add_feature(MapDelta& delta) {
    Feature feature;
    feature.id = ++latest_id_;
    feature.p_exists = number();
    features_[feature.id] = feature;
    delta.changed.push_back(feature);
  }

  void change(MapDelta& delta) {
    for (auto feature = features_.begin(); feature != features_.end();) {
      if (!delta.full && chance(0.2)) {
        delta.gone.push_back({feature->first, GoneReason::kLeft, {}});
        feature = features_.erase(feature);
        continue;
      }
      if (!delta.full && chance(0.3)) {
        feature->second.p_exists = number();
        delta.changed.push_back(feature->second);
      }
      ++feature;
    }
    while (chance(0.5)) add_feature(delta);
  }

  std::mt19937 random_;
  std::uint64_t map_ = 0, version_ = 0;
  FeatureId latest_id_ = 0;
  std::map<FeatureId, Feature> features_;
};

std::vector<double> states_of(const std::vector<Feature>& features) {
  std::vector<double> result;
  for (const Feature& feature : features) {
    result.push_back(static_cast<double>(feature.id));
    result.push_back(feature.p_exists);
  }
  return result;
}

TEST(PendingChanges, WhoAppliesTheSumsHasTheMap) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    ChangingMap map(seed);
    PendingChanges pending;
    MapReplica replica;
    std::mt19937 random(seed);
    for (int i = 0; i < 300; ++i) {
      pending.add(map.next());
      if (!std::bernoulli_distribution(0.3)(random)) continue;
      ASSERT_EQ(replica.apply(pending.take()), Verdict::kTaken) << "seed " << seed << ", update " << i;
      ASSERT_EQ(states_of(replica.map().features), states_of(map.all())) << "seed " << seed << ", update " << i;
    }
  }
}

TEST(PendingChanges, WhoMissedASumTakesNoneUntilAFullOne) {
  ChangingMap map(3);
  PendingChanges pending;
  MapReplica replica;
  bool missed = false;
  int refused = 0;
  for (int i = 0; i < 300; ++i) {
    pending.add(map.next());
    const MapDelta sum = pending.take();
    if (i % 10 == 5) {
      missed = true;
      continue;
    }
    const Verdict verdict = replica.apply(sum);
    ASSERT_EQ(verdict, missed && !sum.full ? Verdict::kMissed : Verdict::kTaken) << i;
    if (verdict == Verdict::kMissed) {
      ++refused;
      continue;
    }
    missed = false;
    ASSERT_EQ(states_of(replica.map().features), states_of(map.all())) << i;
  }
  EXPECT_GT(refused, 20);
}

TEST(PendingChanges, AnUpdateThatDoesNotFollowBeginsTheSum) {
  ChangingMap map(5);
  PendingChanges pending;
  pending.add(map.next());
  pending.clear();
  MapDelta delta = map.next();
  while (delta.full) delta = map.next();
  pending.add(delta);
  const MapDelta sum = pending.take();
  EXPECT_FALSE(sum.full);
  EXPECT_EQ(sum.base, delta.base);
  EXPECT_EQ(sum.version, delta.version);
}

}  // namespace
}  // namespace situation_awareness::pending_changes_test
