// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/map_evaluation.hpp"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "situation_awareness/common/random.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness::map_evaluation_test {
namespace {

Object object_at(std::uint64_t id, double x_m, int beams = 20) {
  Object object;
  object.id = id;
  object.ellipse_world = {{x_m, 0.0}, 0.0, 0.3, 0.2};
  object.beams = beams;
  return object;
}

Objects objects_at(double time_s, std::vector<Object> objects) {
  return {nanoseconds(time_s), 0.0, std::move(objects)};
}

TEST(MapEvaluation, APerfectMapHasNoErrors) {
  MapEvaluation evaluation;
  for (int i = 0; i < 10; ++i) {
    evaluation.add(objects_at(0.1 * i, {object_at(1, 0.0), object_at(2, 5.0)}),
                   objects_at(0.1 * i, {object_at(7, 0.0), object_at(9, 5.0)}));
  }
  const MapScore score = evaluation.score();
  EXPECT_EQ(score.scans, 10);
  EXPECT_EQ(score.recall, 1.0);
  EXPECT_EQ(score.center_rmse_m, 0.0);
  EXPECT_EQ(score.max_delay_s, 0.0);
  EXPECT_EQ(score.longest_false_s, 0.0);
  EXPECT_EQ(score.objects.at(0).id_switches, 0);
}

TEST(MapEvaluation, MeasuresErrorsDelaysAndDurationsOfFalseElements) {
  MapEvaluation evaluation;
  for (int i = 0; i < 20; ++i) {
    std::vector<Object> map;
    if (i >= 5) map.push_back(object_at(7, 0.03));            // 0.5 s late, 3 cm off
    if (i >= 8 && i <= 14) map.push_back(object_at(8, 3.0));  // on nothing for 0.6 s
    evaluation.add(objects_at(0.1 * i, {object_at(1, 0.0)}), objects_at(0.1 * i, map));
  }
  const MapScore score = evaluation.score();
  EXPECT_NEAR(score.center_rmse_m, 0.03, 1e-12);
  EXPECT_NEAR(score.max_delay_s, 0.5, 1e-9);
  EXPECT_NEAR(score.longest_false_s, 0.6, 1e-9);
  EXPECT_NEAR(score.false_per_scan, 7.0 / 20.0, 1e-12);
  EXPECT_NEAR(score.recall, 15.0 / 20.0, 1e-12);
}

TEST(MapEvaluation, AnElementOnAFixtureIsNeitherCorrectNorFalse) {
  const Box cabinet{{3.0, 0.5}, 0.0, 1.0, 0.4};  // 0.1 m from the elements' line
  for (const bool known : {true, false}) {
    MapEvaluation evaluation({}, {}, known ? std::vector<Box>{cabinet} : std::vector<Box>{});
    for (int i = 0; i < 10; ++i) {
      evaluation.add(objects_at(0.1 * i, {object_at(1, 0.0), object_at(2, 2.1)}),
                     objects_at(0.1 * i, {object_at(7, 0.0), object_at(8, 3.9), object_at(9, 4.2)}));
    }
    const MapScore score = evaluation.score();
    EXPECT_EQ(score.recall, 0.5);  // it is not that of the object beside it
    EXPECT_EQ(score.false_per_scan, known ? 1.0 : 2.0);
    EXPECT_EQ(score.on_fixtures_per_scan, known ? 1.0 : 0.0);
    // GOSPA: one missed, and what is false.
    EXPECT_NEAR(score.gospa_m * score.gospa_m, (known ? 1.0 : 1.5) * 0.25, 1e-9);
  }
}

TEST(MapEvaluation, AHiddenObjectNeitherDelaysNorIsFalse) {
  MapEvaluation evaluation;
  for (int i = 0; i < 20; ++i) {
    evaluation.add(objects_at(0.1 * i, {object_at(1, 0.0, 0), object_at(2, 5.0, 0)}),
                   objects_at(0.1 * i, {object_at(7, 0.1)}));
  }
  const MapScore score = evaluation.score();
  EXPECT_EQ(score.max_delay_s, 0.0);
  EXPECT_EQ(score.longest_false_s, 0.0);
  EXPECT_EQ(score.objects.at(0).visible_scans, 0);
}

TEST(MapEvaluation, AbsentObjectsAreNeitherMissedNorHiddenAndElementsOnThemAreFalse) {
  // Present for the second half of the first second and for the third second; the map keeps it for 0.3 s too long and
  // then has it under another id.
  MapEvaluation evaluation(MapEvaluationParams{}, bodies_of({"post"}));
  for (int i = 0; i < 30; ++i) {
    Object truth = object_at(4, 0.0);
    const bool is_there = (i >= 5 && i < 10) || i >= 20;
    if (!is_there) truth.p_exists = truth.beams = 0;
    std::vector<Object> map;
    if (i >= 5 && i < 13) map.push_back(object_at(7, 0.0));
    if (i >= 20) map.push_back(object_at(8, 0.0));
    evaluation.add(objects_at(0.1 * i, {truth}), objects_at(0.1 * i, map));
  }
  const MapScore score = evaluation.score();
  EXPECT_EQ(score.objects.at(0).visible_scans, 15);
  EXPECT_EQ(score.recall, 1.0);
  EXPECT_EQ(score.max_delay_s, 0.0);
  EXPECT_EQ(score.id_switches, 0);
  EXPECT_TRUE(score.objects.at(0).hidden.empty());
  EXPECT_NEAR(score.false_per_scan, 3.0 / 30.0, 1e-12);
  EXPECT_NEAR(score.longest_false_s, 0.2, 1e-9);
}

TEST(MapEvaluation, CountsIdSwitchesAndASecondElementAsFalse) {
  MapEvaluation evaluation;
  evaluation.add(objects_at(0.0, {object_at(1, 0.0)}), objects_at(0.0, {object_at(7, 0.0)}));
  evaluation.add(objects_at(0.1, {object_at(1, 0.0)}), objects_at(0.1, {object_at(7, 0.3), object_at(8, 0.0)}));
  const MapScore score = evaluation.score();
  EXPECT_EQ(score.objects.at(0).id_switches, 1);
  EXPECT_NEAR(score.false_per_scan, 0.5, 1e-12);
}

TEST(MapEvaluation, CountsASwitchAcrossATimeOffTheMap) {
  MapEvaluation evaluation;
  for (int i = 0; i < 30; ++i) {
    std::vector<Object> map;
    if (i < 10) map.push_back(object_at(7, 0.0));
    if (i >= 20) map.push_back(object_at(8, 0.0));
    evaluation.add(objects_at(0.1 * i, {object_at(1, 0.0)}), objects_at(0.1 * i, map));
  }
  EXPECT_EQ(evaluation.score().id_switches, 1);
}

TEST(MapEvaluation, GivesTheErrorsOfEachParameter) {
  // Two scans: described with its axes swapped and its psi half a turn off, the first is exact.
  Object truth = object_at(1, 1.0);
  truth.ellipse_world.psi_rad = radians(80.0);
  Object first = truth, second = truth;
  first.id = second.id = 7;
  first.ellipse_world = {{1.0, 0.0}, radians(80.0 - 90.0 + 180.0), 0.2, 0.3};
  second.ellipse_world = {{1.04, -0.02}, radians(-95.0), 0.31, 0.17};
  second.covariance(object_error::kOrientation, object_error::kOrientation) = 0.08;
  MapEvaluation evaluation;
  evaluation.add(objects_at(0.0, {truth}), objects_at(0.0, {first}));
  evaluation.add(objects_at(0.1, {truth}), objects_at(0.1, {second}));
  const ObjectScore object = evaluation.score().objects.at(0);
  EXPECT_NEAR(object.mean_square.rx_m, 0.5 * 0.01 * 0.01, 1e-12);
  EXPECT_NEAR(object.mean_square.ry_m, 0.5 * 0.03 * 0.03, 1e-12);
  EXPECT_NEAR(object.mean_square.tx_m, 0.5 * 0.04 * 0.04, 1e-12);
  EXPECT_NEAR(object.mean_square.ty_m, 0.5 * 0.02 * 0.02, 1e-12);
  EXPECT_NEAR(object.mean_square.psi_rad, 0.5 * radians(5.0) * radians(5.0), 1e-12);
  EXPECT_NEAR(object.max_absolute.ry_m, 0.03, 1e-12);
  EXPECT_NEAR(object.max_absolute.psi_rad, radians(5.0), 1e-12);
  EXPECT_NEAR(object.psi_sigma_rms_rad, 0.2, 1e-12);
  EXPECT_NEAR(object.radius_mae_m, 0.5 * 0.5 * (0.01 + 0.03), 1e-12);
}

TEST(MapEvaluation, TellsStandingFromMovingByWhetherAnObjectEverMoves) {
  MapEvaluation evaluation;
  for (int i = 0; i < 10; ++i) {
    Object pausing = object_at(2, 5.0);
    if (i == 4) pausing.velocity_world_m_s = {0.5, 0.0};
    Object off = object_at(8, 5.03);
    off.ellipse_world.rx_m += 0.02;
    evaluation.add(objects_at(0.1 * i, {object_at(1, 0.0), pausing}), objects_at(0.1 * i, {object_at(7, 0.01), off}));
  }
  const MapScore score = evaluation.score();
  EXPECT_FALSE(score.objects.at(0).moves);
  EXPECT_TRUE(score.objects.at(1).moves);
  EXPECT_EQ(score.standing.scans, 10);
  EXPECT_NEAR(score.standing.center_rmse_m, 0.01, 1e-12);
  EXPECT_NEAR(score.standing.semi_axis_mae_m, 0.0, 1e-12);
  EXPECT_NEAR(score.moving.center_rmse_m, 0.03, 1e-12);
  EXPECT_NEAR(score.moving.velocity_rmse_m_s, 0.5 / std::sqrt(10.0), 1e-12);
  EXPECT_NEAR(score.moving.semi_axis_mae_m, 0.01, 1e-12);
}

TEST(MapEvaluation, TheRegionOf99PercentHolds99PercentOfMatchedErrors) {
  // Correlated errors of the very covariance that the map states, and the same with twice the deviation.
  Vector8d sigma;
  sigma << 0.01, 0.03, 0.1, 0.2, 0.1, 0.1, 0.01, 0.02;
  Matrix8d L = sigma.asDiagonal();
  L(object_error::kVelocity, object_error::kPosition) = 0.15;
  L(object_error::kRadii + 1, object_error::kRadii) = -0.01;
  const auto held = [&](double factor) {
    Random random(5);
    MapEvaluation evaluation;
    for (int i = 0; i < 20000; ++i) {
      Object truth = object_at(1, 0.0), element = object_at(7, 0.0);
      truth.ellipse_world.rx_m = element.ellipse_world.rx_m = 0.5;
      Vector8d white;
      for (double& value : white) value = random.normal();
      const Vector8d error = factor * L * white;
      element.ellipse_world.center_m += error.segment<2>(object_error::kPosition);
      element.velocity_world_m_s += error.segment<2>(object_error::kVelocity);
      element.ellipse_world.rx_m += error[object_error::kRadii];
      element.ellipse_world.ry_m += error[object_error::kRadii + 1];
      element.covariance = L * L.transpose();
      evaluation.add(objects_at(0.1 * i, {truth}), objects_at(0.1 * i, {element}));
    }
    return evaluation.score().held_99;
  };
  constexpr double kFourSigma = 0.003;  // of the binomial
  const Held99 matched = held(1.0);
  EXPECT_NEAR(matched.position, 0.99, kFourSigma);
  EXPECT_NEAR(matched.position_velocity, 0.99, kFourSigma);
  EXPECT_NEAR(matched.radii, 0.99, kFourSigma);
  // Of twice the deviation 1 - 0.01^(1/4) are held with 2 degrees of freedom: P(chi2_2 < x) = 1 - exp(-x / 2).
  EXPECT_NEAR(held(2.0).position, 1.0 - std::pow(0.01, 0.25), 0.014);
}

TEST(MapEvaluation, GospaIgnoresHiddenObjectsAndElementsOnThem) {
  MapEvaluation evaluation;
  const ScanScore scan = evaluation.add(
      objects_at(0.0, {object_at(1, 0.0), object_at(2, 3.0, 2), object_at(3, 6.0), object_at(4, 9.0, 0)}),
      objects_at(0.0, {object_at(7, 0.1), object_at(8, 3.2), object_at(9, 20.0)}));
  EXPECT_EQ(scan.missed, 1);
  EXPECT_EQ(scan.false_elements, 1);
  EXPECT_NEAR(scan.gospa_m, std::sqrt(0.1 * 0.1 + 0.5 * 0.25 * 2), 1e-12);
  evaluation.add(objects_at(0.1, {}), objects_at(0.1, {}));
  EXPECT_NEAR(evaluation.score().gospa_m, 0.5 * scan.gospa_m, 1e-12);
}

// --- hidden times ---------------------------------------------------------------------------------------------------

/// The hidden times of one object over 10 s at 10 Hz. `beams_at` and `id_at`: its beams and the id of the element on
/// it, 0 for none, at each tenth of a second.
std::vector<HiddenTime> hidden_times(const std::function<int(int)>& beams_at, const std::function<int(int)>& id_at) {
  MapEvaluation evaluation;
  for (int i = 0; i < 100; ++i) {
    std::vector<Object> map;
    if (id_at(i) != 0) map.push_back(object_at(static_cast<std::uint64_t>(id_at(i)), 0.0));
    evaluation.add(objects_at(0.1 * i, {object_at(1, 0.0, beams_at(i))}), objects_at(0.1 * i, map));
  }
  return evaluation.score().objects.at(0).hidden;
}

int hidden_from_2_to_5(int i) { return i < 20 || i >= 50 ? 20 : 0; }

TEST(HiddenTimes, EndWithTheSameElementOrAnother) {
  const auto same = hidden_times(hidden_from_2_to_5, [](int) { return 7; });
  ASSERT_EQ(same.size(), 1U);
  EXPECT_NEAR(same[0].from_s, 2.0, 1e-9);
  EXPECT_NEAR(same[0].to_s, 5.0, 1e-9);
  EXPECT_EQ(same[0].same_id, true);
  EXPECT_FALSE(same[0].deleted_after_s);

  const auto other = hidden_times(hidden_from_2_to_5, [](int i) { return i < 30 ? 7 : i < 55 ? 0 : 8; });
  ASSERT_EQ(other.size(), 1U);
  EXPECT_EQ(other[0].same_id, false);
  EXPECT_NEAR(other[0].deleted_after_s.value(), 1.0, 1e-9);
}

TEST(HiddenTimes, AllowOneSecondForTheElementToReturn) {
  // The element of before comes back 1 s after the object does, or 1.1 s.
  const auto id_back_at = [](int back) { return [back](int i) { return i < 25 || i >= back ? 7 : 0; }; };
  EXPECT_EQ(hidden_times(hidden_from_2_to_5, id_back_at(60)).at(0).same_id, true);
  EXPECT_EQ(hidden_times(hidden_from_2_to_5, id_back_at(61)).at(0).same_id, false);
}

TEST(HiddenTimes, ContinueOverAFewBeams) {
  const auto hidden = hidden_times([](int i) { return i == 40             ? 2
                                                      : i >= 50 && i < 60 ? 3
                                                                          : hidden_from_2_to_5(i); },
                                   [](int) { return 7; });
  ASSERT_EQ(hidden.size(), 1U);
  EXPECT_NEAR(hidden[0].to_s, 5.0, 1e-9) << "the first beam for good, though not enough to be visible";
  EXPECT_EQ(hidden[0].same_id, true);
}

TEST(HiddenTimes, AreNotCountedWhenShortOrBeforeTheFirstElement) {
  EXPECT_TRUE(hidden_times([](int i) { return i % 10 < 4 ? 0 : 20; }, [](int) { return 7; }).empty());
  EXPECT_EQ(hidden_times([](int i) { return i % 10 < 5 ? 0 : 20; }, [](int) { return 7; }).size(), 9U);
  EXPECT_TRUE(hidden_times(hidden_from_2_to_5, [](int i) { return i < 20 ? 0 : 7; }).empty());
}

TEST(HiddenTimes, OfARunThatEndsMeanwhileHaveNoResult) {
  const auto hidden = hidden_times([](int i) { return i < 60 ? 20 : 0; }, [](int i) { return i < 90 ? 7 : 0; });
  ASSERT_EQ(hidden.size(), 1U);
  EXPECT_NEAR(hidden[0].to_s, 9.9, 1e-9);
  EXPECT_FALSE(hidden[0].same_id);
  EXPECT_NEAR(hidden[0].deleted_after_s.value(), 3.0, 1e-9);
}

// --- bodies ---------------------------------------------------------------------------------------------------------

/// A torso at 0, an arm 0.7 m away, and a post far off; the post comes first in the file.
Objects person_and_post(double time_s) {
  return objects_at(time_s, {object_at(1, 5.0), object_at(2, 0.0, 3), object_at(3, 0.7, 3)});
}
const std::vector<Body> kPersonAndPost = {{"post", {0}}, {"person", {1, 2}}};

TEST(Bodies, AreMappedByOneElementAnywhereOnThem) {
  MapEvaluation evaluation({}, kPersonAndPost);
  for (int i = 0; i < 10; ++i) {  // an element on the arm's far side, 0.9 m from the torso
    evaluation.add(person_and_post(0.1 * i), objects_at(0.1 * i, {object_at(7, 5.0), object_at(8, 0.9)}));
  }
  const MapScore score = evaluation.score();
  ASSERT_EQ(score.objects.size(), 2U);
  EXPECT_EQ(score.objects[1].truth_id, 2U);
  EXPECT_EQ(score.objects[1].visible_scans, 10) << "3 beams on each of two parts are 6 on the body";
  EXPECT_EQ(score.recall, 1.0);
  EXPECT_EQ(score.false_per_scan, 0.0);
  EXPECT_NEAR(score.objects[1].center_rmse_m, 0.9, 1e-12) << "from the torso";
}

TEST(Bodies, ASecondElementOnThemIsFalseAndTheOneAtTheTorsoIsMatched) {
  MapEvaluation evaluation({}, kPersonAndPost);
  evaluation.add(person_and_post(0.0), objects_at(0.0, {object_at(7, 5.0), object_at(8, 0.02)}));
  evaluation.add(person_and_post(0.1), objects_at(0.1, {object_at(7, 5.0), object_at(8, 0.02), object_at(9, 0.7)}));
  const MapScore score = evaluation.score();
  EXPECT_EQ(score.id_switches, 0);
  EXPECT_NEAR(score.false_per_scan, 0.5, 1e-12);
  EXPECT_NEAR(score.objects[1].center_rmse_m, 0.02, 1e-12);
}

TEST(Bodies, CountScansAsOneElementOnceTheyHaveSettled) {
  MapEvaluation evaluation({}, kPersonAndPost);
  for (int i = 0; i < 40; ++i) {
    std::vector<Object> map = {object_at(8, 0.3)};
    if (i < 15) map.push_back(object_at(9, 0.7));
    const int parts = i < 30 ? 2 : 1;
    evaluation.add(person_and_post(0.1 * i), objects_at(0.1 * i, map), {1, parts});
  }
  const MapScore score = evaluation.score();
  ASSERT_EQ(score.bodies.size(), 1U);
  EXPECT_EQ(score.bodies[0].name, "person");
  EXPECT_EQ(score.bodies[0].scans_apart, 20);
  EXPECT_EQ(score.bodies[0].scans_one, 15);
}

TEST(MapEvaluation, TheTableNamesEachObject) {
  MapEvaluation evaluation;
  evaluation.add(objects_at(0.0, {object_at(1, 0.0)}), objects_at(0.0, {object_at(7, 0.0)}));
  const std::string table = format_table(evaluation.score(), {{1, "barrel"}});
  EXPECT_NE(table.find("barrel"), std::string::npos);
  EXPECT_NE(table.find("centre RMSE 0.000 m"), std::string::npos);
}

}  // namespace
}  // namespace situation_awareness::map_evaluation_test
