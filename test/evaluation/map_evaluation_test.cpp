// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/map_evaluation.hpp"

#include <gtest/gtest.h>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {
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

TEST(MapEvaluation, MeasuresErrorsDelaysAndFalseLives) {
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

TEST(MapEvaluation, CountsWhenAnotherElementTakesOverAndASecondOneAsFalse) {
  MapEvaluation evaluation;
  evaluation.add(objects_at(0.0, {object_at(1, 0.0)}), objects_at(0.0, {object_at(7, 0.0)}));
  evaluation.add(objects_at(0.1, {object_at(1, 0.0)}), objects_at(0.1, {object_at(7, 0.3), object_at(8, 0.0)}));
  const MapScore score = evaluation.score();
  EXPECT_EQ(score.objects.at(0).id_switches, 1);
  EXPECT_NEAR(score.false_per_scan, 0.5, 1e-12);
}

TEST(MapEvaluation, TheTableNamesEachObject) {
  MapEvaluation evaluation;
  evaluation.add(objects_at(0.0, {object_at(1, 0.0)}), objects_at(0.0, {object_at(7, 0.0)}));
  const std::string table = format_table(evaluation.score(), {{1, "barrel"}});
  EXPECT_NE(table.find("barrel"), std::string::npos);
  EXPECT_NE(table.find("centre RMSE 0.000 m"), std::string::npos);
}

}  // namespace
}  // namespace situation_awareness
