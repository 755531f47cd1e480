// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/evaluation/feature_evaluation.hpp"

#include <cmath>
#include <stdexcept>
#include <utility>

#include <gtest/gtest.h>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness::feature_evaluation_test {
namespace {

using Line = std::vector<Eigen::Vector2d>;

/// Hits at places in the world, of a scanner at the origin.
Points scan_of(const Line& hits) {
  Points points;
  for (const Eigen::Vector2d& p : hits) {
    Point point;
    point.azimuth_rad = std::atan2(p.y(), p.x());
    point.range_m = p.norm();
    point.p_level_m = p;
    point.state = BeamState::kHit;
    points.points.push_back(point);
  }
  return points;
}

/// In the middle of each piece of 0.1 m.
Line hits_along(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  const int pieces = static_cast<int>(std::lround((to - from).norm() / 0.1));
  Line hits;
  for (int i = 0; i < pieces; ++i) hits.emplace_back(from + (i + 0.5) / pieces * (to - from));
  return hits;
}

/// 10 m x 0.2 m, whose side at y = 5 is seen from the origin.
SceneThing wall() { return {"wall", {{true, {{-5.0, 5.0}, {5.0, 5.0}, {5.0, 5.2}, {-5.0, 5.2}}}}, {}}; }
Line hits_on_wall() { return hits_along({-5.0, 5.0}, {5.0, 5.0}); }

/// A square of 1 m whose side at x is seen from the origin.
SceneThing crate_at(double x_m, bool is_there = true) {
  const Box box{{x_m + 0.5, 0.0}, 0.0, 0.5, 0.5};
  Object part;
  part.id = 1;
  part.shape = Shape::kBox;
  part.box_world = box;
  part.ellipse_world = moment_equal_ellipse(box);
  const std::array<Eigen::Vector2d, 4> outline = corners(box);
  return {"crate", {{is_there, {outline.begin(), outline.end()}}}, {part}};
}
Line hits_on_crate(double x_m) { return hits_along({x_m, -0.5}, {x_m, 0.5}); }

SceneThing pole(const Ellipse& ellipse) {
  Object part;
  part.id = 2;
  part.ellipse_world = ellipse;
  return {"pole", {{true, points_on(ellipse, kOutlinePoints)}}, {part}};
}

Feature line_feature(FeatureId id, const Line& points, bool closed = false) {
  Feature feature;
  feature.id = id;
  PolylineShape shape;
  for (const Eigen::Vector2d& p : points) shape.vertices.push_back({p, 0.01});
  shape.closed = closed;
  feature.shape = shape;
  return feature;
}

Feature ellipse_feature(FeatureId id, const Ellipse& ellipse) {
  Feature feature;
  feature.id = id;
  feature.shape = EllipseShape{ellipse, {}};
  return feature;
}

Feature box_feature(FeatureId id, const Box& box) {
  Feature feature;
  feature.id = id;
  feature.shape = BoxShape{box, {}};
  return feature;
}

/// Once a second the same.
FeatureScore score_of(const std::vector<SceneThing>& things, const Line& hits, const std::vector<Feature>& features,
                      int scans = 5) {
  FeatureEvaluation evaluation;
  for (int i = 0; i < scans; ++i) {
    const std::int64_t stamp_ns = nanoseconds(1.0 * i);
    evaluation.add({stamp_ns, things}, scan_of(hits), {stamp_ns, stamp_ns, 0.0, features});
  }
  return evaluation.score();
}

TEST(FeatureEvaluation, AWallWhoseSeenSideIsOnTheMapIsWhole) {
  const FeatureScore score = score_of({wall()}, hits_on_wall(), {line_feature(3, {{-5.0, 5.0}, {5.0, 5.0}})});
  EXPECT_EQ(score.things.at(0).name, "wall");
  EXPECT_EQ(score.things[0].comparisons, 4);  // after 1 s nothing was hit three times yet
  EXPECT_FALSE(score.things[0].body);
  EXPECT_NEAR(score.on_map_part, 1.0, 1e-12);
  EXPECT_NEAR(score.outline_rms_m, 0.0, 1e-12);
  EXPECT_NEAR(score.features_per_thing, 1.0, 1e-12);
  EXPECT_NEAR(score.unexplained_part, 0.0, 1e-12);
}

TEST(FeatureEvaluation, MeasuresWhatIsMissingAndHowFarOffTheRestIs) {
  const FeatureScore score = score_of({wall()}, hits_on_wall(), {line_feature(3, {{-5.0, 4.95}, {0.0, 4.95}})});
  // The places at x = 0.05, 0.15 and 0.25 are 7, 16 and 25 cm from its end.
  EXPECT_NEAR(score.on_map_part, 0.51, 1e-9);
  const double beyond_m2 = 0.05 * 0.05 + 0.15 * 0.15 + 0.25 * 0.25;
  EXPECT_NEAR(score.outline_rms_m, std::sqrt((53.0 * 0.05 * 0.05 + beyond_m2) / 53.0), 1e-9);
  EXPECT_NEAR(score.features_per_thing, 1.0, 1e-12);
}

TEST(FeatureEvaluation, CountsPiecesAndWhatIsOfNothing) {
  const FeatureScore score =
      score_of({wall()}, hits_on_wall(),
               {line_feature(3, {{-5.0, 5.0}, {0.0, 5.0}}), line_feature(4, {{0.0, 5.0}, {5.0, 5.0}}),
                line_feature(5, {{-1.0, 3.0}, {1.5, 3.0}})});
  EXPECT_NEAR(score.on_map_part, 1.0, 1e-12);
  EXPECT_NEAR(score.features_per_thing, 2.0, 1e-12);
  EXPECT_NEAR(score.things.at(0).features, 2.0, 1e-12);
  EXPECT_NEAR(score.unexplained_part, 2.5 / 12.5, 1e-12);
}

TEST(FeatureEvaluation, WhatWasNotSeenIsNotMissed) {
  const FeatureScore score =
      score_of({wall(), crate_at(3.0)}, hits_on_wall(), {line_feature(3, {{-5.0, 5.0}, {5.0, 5.0}})});
  EXPECT_NEAR(score.on_map_part, 1.0, 1e-12);
  EXPECT_NEAR(score.features_per_thing, 1.0, 1e-12);
  EXPECT_EQ(score.things.at(1).comparisons, 0);
  EXPECT_EQ(score.things[1].body.value().visible_scans, 0);
  EXPECT_NE(format_table(score).find("not seen"), std::string::npos);
}

TEST(FeatureEvaluation, ABodyThatBecomesAPolylineStaysOnTheMap) {
  const Ellipse ellipse{{2.0, 0.0}, 0.0, 0.3, 0.2};
  const Line outline = points_on(ellipse, kOutlinePoints);
  for (const FeatureId later : {FeatureId{7}, FeatureId{8}}) {
    FeatureEvaluation evaluation;
    for (int i = 0; i < 10; ++i) {
      const std::int64_t stamp_ns = nanoseconds(0.1 * i);
      evaluation.add({stamp_ns, {pole(ellipse)}}, scan_of(outline),
                     {stamp_ns,
                      stamp_ns,
                      0.0,
                      {i < 4 ? ellipse_feature(7, ellipse) : line_feature(later, outline, /*closed=*/true)}});
    }
    const FeatureScore score = evaluation.score();
    const ObjectScore body = score.things.at(0).body.value();
    EXPECT_EQ(score.bodies.recall, 1.0);
    EXPECT_EQ(body.visible_scans, 10);
    EXPECT_EQ(body.mapped_scans, 4);
    EXPECT_EQ(body.outline_scans, 6);
    EXPECT_EQ(body.max_delay_s, 0.0);
    EXPECT_EQ(body.id_switches, later == 7 ? 0 : 1);
    EXPECT_NEAR(body.center_rmse_m, 0.0, 1e-12);
    EXPECT_NEAR(score.center_rmse_m, 0.0, 1e-12);
    EXPECT_NEAR(body.outline_rms_m, 0.0, 1e-9);
    EXPECT_EQ(score.bodies.false_per_scan, 0.0);
    EXPECT_EQ(score.bodies.gospa_m, 0.0);
  }
}

TEST(FeatureEvaluation, ABodyWithHalfOfItOnTheMapIsOnIt) {
  // The side is looked at in 10 places, at y = -0.45 to 0.45: 7 are within 10 cm of a line that ends at 0.06, and 4 are
  // within 10 cm of one that ends at -0.24.
  for (const double end_m : {0.06, -0.24}) {
    const FeatureScore score =
        score_of({crate_at(3.0)}, hits_on_crate(3.0), {line_feature(4, {{3.0, end_m}, {3.0, -0.5}})});
    EXPECT_EQ(score.bodies.recall, end_m > 0.0 ? 1.0 : 0.0) << end_m;
  }
}

TEST(FeatureEvaluation, ABoxOfWhichTooLittleIsKnownIsOnTheBodyAndItsOutlineCounts) {
  // The map has a tenth of a box of 1 m, 0.45 m off the middle of the box, where its side is.
  const FeatureScore score =
      score_of({crate_at(3.0)}, hits_on_crate(3.0), {box_feature(4, {{3.05, 0.0}, 0.0, 0.05, 0.5})});
  EXPECT_EQ(score.bodies.recall, 1.0);
  EXPECT_NEAR(score.things.at(0).body.value().center_rmse_m, 0.45, 1e-9);
  EXPECT_EQ(score.center_rmse_m, 0.0);  // boxes are left out
  EXPECT_NEAR(score.outline_rms_m, 0.0, 1e-9);
  EXPECT_EQ(score.bodies.false_per_scan, 0.0);
}

TEST(FeatureEvaluation, AnElementOnAWallIsOneMoreFeatureOfItButNotFalse) {
  const FeatureScore score =
      score_of({wall(), crate_at(3.0)}, hits_on_wall(),
               {line_feature(3, {{-5.0, 5.0}, {5.0, 5.0}}), ellipse_feature(9, {{0.0, 5.0}, 0.0, 0.25, 0.1})});
  EXPECT_EQ(score.bodies.false_per_scan, 0.0);
  EXPECT_EQ(score.bodies.on_fixtures_per_scan, 1.0);
  EXPECT_NEAR(score.features_per_thing, 2.0, 1e-12);
}

TEST(FeatureEvaluation, OfWhatMovesOnlyWhatIsHitNowCounts) {
  for (const double late_m : {0.0, 0.2}) {
    FeatureEvaluation evaluation;
    for (int i = 0; i < 5; ++i) {
      const std::int64_t stamp_ns = nanoseconds(1.0 * i);
      evaluation.add({stamp_ns, {crate_at(2.0 + i)}}, scan_of(hits_on_crate(2.0 + i)),
                     {stamp_ns, stamp_ns, 0.0, {box_feature(4, {{2.5 + i - late_m, 0.0}, 0.0, 0.5, 0.5})}});
    }
    const FeatureScore score = evaluation.score();
    // A late box is 20 cm before the side, but for the ends, from which its other sides are 5 cm away.
    EXPECT_NEAR(score.on_map_part, late_m > 0.0 ? 0.2 : 1.0, 1e-9);
    EXPECT_NEAR(score.things.at(0).body.value().center_rmse_m, late_m, 1e-9);
    EXPECT_NEAR(score.features_per_thing, 1.0, 1e-12);
    EXPECT_EQ(score.bodies.recall, 1.0);
  }
}

TEST(FeatureEvaluation, WhereAThingWasExplainsAFeatureUntilBeamsPass) {
  const std::vector<Feature> features = {line_feature(4, {{3.0, 0.5}, {3.0, -0.5}})};
  const Line beyond = hits_along({9.0, -0.5}, {9.0, 0.5});
  FeatureEvaluation evaluation;
  for (int i = 0; i < 4; ++i) {
    const std::int64_t stamp_ns = nanoseconds(1.0 * i);
    evaluation.add({stamp_ns, {crate_at(3.0, i == 0)}},
                   scan_of(i == 0   ? hits_on_crate(3.0)
                           : i == 3 ? beyond
                                    : Line{}),
                   {stamp_ns, stamp_ns, 0.0, features});
    EXPECT_NEAR(evaluation.score().unexplained_part, i == 3 ? 0.25 : 0.0, 1e-12) << i;
  }
}

TEST(FeatureEvaluation, ThingsStayTheSame) {
  FeatureEvaluation evaluation;
  evaluation.add({0, {wall()}}, {}, {});
  EXPECT_THROW(evaluation.add({1, {crate_at(3.0)}}, {}, {}), std::invalid_argument);
  EXPECT_THROW(evaluation.add({1, {}}, {}, {}), std::invalid_argument);
}

TEST(FeatureEvaluation, WithoutAScanNothingIsCompared) {
  const FeatureScore score = FeatureEvaluation().score();
  EXPECT_EQ(score.bodies.scans, 0);
  EXPECT_EQ(score.on_map_part, 0.0);
  EXPECT_FALSE(format_table(score).empty());
}

}  // namespace
}  // namespace situation_awareness::feature_evaluation_test
