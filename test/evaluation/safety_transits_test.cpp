// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/safety_transits.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness::safety_transits_test {
namespace {

constexpr SafetyPolicy kPolicies[] = {SafetyPolicy::kConservative, SafetyPolicy::kUpdated, SafetyPolicy::kIgnoreKnown};

TransitOutcome run(const TransitScene& scene, SafetyPolicy policy, std::uint64_t seed) {
  TransitParams params;
  params.safety.policy = policy;
  return simulate_transit(scene, params, seed);
}

TEST(SafetyTransits, AreTheSameForTheSameSeed) {
  const TransitScene scene = scene_with_walker(3);
  const TransitOutcome a = run(scene, SafetyPolicy::kUpdated, 3), b = run(scene, SafetyPolicy::kUpdated, 3);
  EXPECT_EQ(a.time_s, b.time_s);
  EXPECT_EQ(a.least_clearance_m, b.least_clearance_m);
}

TEST(SafetyTransits, AnEmptyCorridorIsDrivenAtFullSpeed) {
  TransitScene scene;
  const TransitOutcome outcome = run(scene, SafetyPolicy::kUpdated, 1);
  ASSERT_TRUE(outcome.arrived);
  // 12 m at 0.5 m/s, acceleration at 0.3 and slowing at 0.5 m/s^2, and the last centimetres.
  EXPECT_NEAR(outcome.time_s, 12.0 / 0.5 + 0.25 / 0.3 + 0.25 / 0.5, 1.0);
}

// Without the safety areas' braking the vehicle runs into the walker: the simulation can show what it is to show.
TEST(SafetyTransits, AVehicleThatDoesNotBrakeTouches) {
  TransitParams blind;
  blind.safety.mover_speed_m_s = 0.1;
  blind.safety.margin_m = blind.safety.floor_margin_m = blind.safety.standoff_m = 0.0;
  blind.safety.min_hits = 100;
  blind.vehicle.reaction_s = 0.0;
  blind.vehicle.slowing_m_s2 = blind.vehicle.braking_m_s2 = 20.0;
  int touched = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    touched += simulate_transit(scene_with_walker(seed), blind, seed).touched ? 1 : 0;
  }
  EXPECT_GT(touched, 0);
}

TEST(SafetyTransits, NewBoxesArePassedOrStoppedFor) {
  TransitScene scene = scene_with_boxes(2);
  scene.new_boxes = {{{6.0, 0.1}, 0.0, 0.2, 0.2}};  // on the way
  const TransitOutcome outcome = run(scene, SafetyPolicy::kIgnoreKnown, 1);
  EXPECT_FALSE(outcome.arrived);
  EXPECT_FALSE(outcome.hit_box);
}

TEST(SafetyTransits, UpdatedAreasSaveTime) {
  for (std::uint64_t seed = 1; seed <= 1; ++seed) {
    const TransitScene scene = scene_with_boxes(seed);
    const TransitOutcome conservative = run(scene, SafetyPolicy::kConservative, seed);
    const TransitOutcome updated = run(scene, SafetyPolicy::kUpdated, seed);
    EXPECT_TRUE(conservative.arrived && updated.arrived);
    EXPECT_FALSE(conservative.hit_box || updated.hit_box);
    EXPECT_LE(updated.time_s, 0.85 * conservative.time_s);
  }
}

TEST(SafetyTransits, NobodyIsTouched) {
  for (const SafetyPolicy policy : kPolicies) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      const TransitOutcome outcome = run(scene_with_walker(seed), policy, seed);
      EXPECT_FALSE(outcome.touched) << name_of(policy) << ' ' << seed;
      EXPECT_FALSE(outcome.hit_box) << name_of(policy) << ' ' << seed;
    }
  }
}

/// Whether a box is in the way of the scanner's sight of a place, by places on the line between them.
bool is_hidden(const TransitScene& scene, const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m) {
  constexpr int kPlaces = 150;
  for (int i = 0; i <= kPlaces; ++i) {
    const Eigen::Vector2d p_m = from_m + (to_m - from_m) * (static_cast<double>(i) / kPlaces);
    for (const Box& box : scene.known_boxes) {
      if (offset_m(box, p_m) < -0.02) return true;
    }
  }
  return false;
}

/// Draws contacts at random, and counts those before which the walker was hidden while the vehicle needed to stand: it
/// came at its full speed or at others drawn at random, and they came walking or stood for some time.
int contacts_out_of_hiding(const TransitScene& scene, const VehicleParams& vehicle, int contacts, Random& random) {
  constexpr double kStep_s = 0.03;
  const Walker& walker = *scene.walker;
  const double way_m = (walker.to_m - walker.from_m).norm();
  const auto walker_m = [&](double at_m) {
    return Eigen::Vector2d(walker.from_m + (walker.to_m - walker.from_m) * (at_m / way_m));
  };
  int hidden = 0;
  for (int found = 0; found < contacts;) {
    double at_m = random.uniform(0.0, way_m);
    Eigen::Vector2d base_m(walker_m(at_m).x() + random.uniform(-1.0, 1.0), 0.0);
    const double gap_m = clearance_m(vehicle.footprint, walker_m(at_m) - base_m);
    const bool is_first_touch = gap_m <= Walker::kRadius_m && gap_m > Walker::kRadius_m - 0.03;
    if (base_m.x() < 0.0 || base_m.x() > scene.length_m || !is_first_touch) continue;
    ++found;
    const double slowest_m_s = random.uniform() < 0.5 ? vehicle.max_speed_m_s : 0.0;
    const double stood_s = random.uniform() < 0.5 ? 0.0 : random.uniform(0.0, 1.0);
    bool was_hidden = false;
    for (double ago_s = 0.0; ago_s < longest_time_to_stand_s(vehicle) && base_m.x() >= 0.0; ago_s += kStep_s) {
      was_hidden = was_hidden || is_hidden(scene, base_m, walker_m(at_m));
      base_m.x() -= kStep_s * random.uniform(slowest_m_s, vehicle.max_speed_m_s);
      if (ago_s >= stood_s) at_m = std::max(at_m - kStep_s * walker.speed_m_s, 0.0);
    }
    hidden += was_hidden ? 1 : 0;
  }
  return hidden;
}

VehicleParams vehicle_of_shape(std::size_t shape) {
  VehicleParams vehicle;
  vehicle.footprint = footprint_of_shape(shape);
  return vehicle;
}

TEST(SafetyTransits, WhoStepsIntoTheWayIsInViewBefore) {
  Random random(1);
  for (std::uint64_t seed = 9416; seed < 9416 + 2000; ++seed) {
    const VehicleParams vehicle = vehicle_of_shape(seed % kShapes);
    const TransitScene scene = scene_with_walker(seed, vehicle);
    const int contacts = seed == 9416 ? 1000 : 20;
    EXPECT_EQ(contacts_out_of_hiding(scene, vehicle, contacts, random), 0) << seed;
  }
}

// Few scenes are drawn anew, those in which somebody steps out of hiding: so near as it can be told beforehand.
TEST(SafetyTransits, ScenesOutOfHidingAreKeptApart) {
  Random random(2);
  const VehicleParams vehicle = vehicle_of_shape(2);
  int kept_apart = 0, confirmed = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    std::vector<TransitScene> out_of_hiding;
    scene_with_walker(seed, vehicle, &out_of_hiding);
    for (const TransitScene& scene : out_of_hiding) {
      ++kept_apart;
      confirmed += contacts_out_of_hiding(scene, vehicle, 5000, random) > 0 ? 1 : 0;
    }
  }
  EXPECT_GT(kept_apart, 0);
  EXPECT_LE(kept_apart, 300 / 20);
  EXPECT_GE(2 * confirmed, kept_apart);
}

// What the safety areas do not promise: someone runs out from behind a known box, and the vehicle brakes too late.
TEST(SafetyTransits, WhoRunsOutOfHidingMayBeTouched) {
  const TransitWithFault run = transit_with_fault(SafetyPolicy::kIgnoreKnown, 9416);
  ASSERT_EQ(run.out_of_hiding.size(), 1U);
  const TransitOutcome outcome = simulate_transit(run.out_of_hiding.front(), run.params, 9416);
  ASSERT_TRUE(outcome.touched);
  EXPECT_LT(outcome.touch_in_view_s, longest_time_to_stand_s(run.params.vehicle));
  EXPECT_LT(outcome.touch_speed_m_s, 0.05);
}

void expect_no_harm(SafetyPolicy policy, std::uint64_t seed) {
  const TransitWithFault run = transit_with_fault(policy, seed);
  const TransitOutcome outcome = simulate_transit(run.scene, run.params, seed);
  const std::string what = std::string(name_of(policy)) + ' ' + std::to_string(seed) + ' ' + name_of(run.params.fault) +
                           " at " + std::to_string(run.params.fault_s) + " s";
  EXPECT_FALSE(outcome.touched) << what << ", at " << outcome.touch_speed_m_s << " m/s";
  EXPECT_FALSE(outcome.hit_box) << what;
  if (!has_to_stop(run.params.fault) || (outcome.arrived && !outcome.found)) return;
  EXPECT_TRUE(outcome.found) << what;
  EXPECT_TRUE(outcome.stands) << what;
  EXPECT_LE(outcome.way_to_stand_m, longest_way_to_stand_m(outcome, run.params)) << what;
}

TEST(SafetyTransits, NobodyIsTouchedWhateverFails) {
  for (const SafetyPolicy policy : kPolicies) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) expect_no_harm(policy, seed);
    expect_no_harm(policy, 9416);
  }
}

// A vehicle with a tail of 0.6 m drives there and back, and turns where a box may be in its circle.
TEST(SafetyTransits, ATailHitsNoKnownBoxWhereItTurns) {
  int arrived = 0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    TransitParams params;
    params.vehicle.footprint = footprint_of_shape(1);
    params.path.transits = 2;
    params.path.pause_s = 0.5;
    params.longest_s = 40.0;
    const TransitOutcome outcome = simulate_transit(scene_with_box_at_the_end(seed), params, seed);
    EXPECT_FALSE(outcome.hit_box) << seed;
    arrived += outcome.arrived ? 1 : 0;
  }
  EXPECT_GT(arrived, 0) << "where nothing is in the circle it turns";
}

TEST(SafetyTransitsLong, NobodyIsTouchedWhateverFails) {
  for (const SafetyPolicy policy : kPolicies) {
    for (std::uint64_t seed = 1; seed <= 300; ++seed) expect_no_harm(policy, seed);
  }
}

TEST(SafetyTransitsLong, NobodyIsTouchedInAThousandRuns) {
  for (const SafetyPolicy policy : kPolicies) {
    int stopped = 0;
    for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
      const TransitOutcome outcome = run(scene_with_walker(seed), policy, seed);
      EXPECT_FALSE(outcome.touched) << name_of(policy) << ' ' << seed;
      stopped += outcome.least_speed_m_s < 0.01 ? 1 : 0;
    }
    EXPECT_GT(stopped, 200) << "they are in the way";
  }
}

TEST(SafetyTransitsLong, UpdatedAreasSaveTime) {
  double conservative_s = 0.0, updated_s = 0.0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const TransitScene scene = scene_with_boxes(seed);
    conservative_s += run(scene, SafetyPolicy::kConservative, seed).time_s;
    updated_s += run(scene, SafetyPolicy::kUpdated, seed).time_s;
  }
  EXPECT_LE(updated_s, 0.85 * conservative_s);
}

}  // namespace
}  // namespace situation_awareness::safety_transits_test
