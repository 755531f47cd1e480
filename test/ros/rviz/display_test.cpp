// SPDX-License-Identifier: BSD-3-Clause
// The display as loaded by rviz, drawing into an invisible window: content of the picture, by position.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "display_fixture.hpp"
#include "situation_awareness/MapUpdate.h"
#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/geometry/ellipse.hpp"
#include "situation_awareness/map/map.hpp"
#include "situation_awareness/ros/convert/map.hpp"
#include "situation_awareness/ros/markers/colors.hpp"

namespace situation_awareness {
namespace {

class DisplayTest : public DisplayFixture {
 protected:
  void SetUp() override {
    DisplayFixture::SetUp();
    connect(manager_->createDisplay("situation_awareness/SemanticMap", "Map", true),
            node_.advertise<MapUpdate>("semantic_map/updates", 10));
    display_->subProp("Uncertainty")->setValue(false);
    display_->subProp("Color")->setValue("id");
  }

  static Feature feature(FeatureId id, const FeatureShape& shape) {
    Feature feature;
    feature.id = id;
    feature.shape = shape;
    return feature;
  }

  static Feature body(FeatureId id, const Ellipse& ellipse_world, const Eigen::Vector2d& velocity_world_m_s = {0, 0}) {
    EllipseShape shape{ellipse_world, {}};
    shape.body.velocity_world_m_s = velocity_world_m_s;
    shape.body.covariance = 1e-6 * Matrix8d::Identity();
    return feature(id, shape);
  }

  void publish(const MapDelta& delta, const std::string& frame = "world") {
    maps_.publish(map_delta_to_msg(delta, "9b2c", frame));
  }

  MapDelta delta(std::uint64_t base, const std::vector<Feature>& changed, const std::vector<Gone>& gone = {}) {
    MapDelta delta;
    delta.stamp_ns = stamp_ns_ += 100'000'000;
    delta.base = base;
    delta.version = base + 1;
    delta.full = base == 0;
    delta.changed = changed;
    delta.gone = gone;
    return delta;
  }

  /// A later version of the map, which has this alone.
  MapDelta whole(const Feature& feature) { return whole(std::vector<Feature>{feature}); }
  MapDelta whole(const std::vector<Feature>& features) {
    MapDelta result = delta(0, features);
    for (Feature& feature : result.changed) feature.last_seen_ns = result.stamp_ns;
    result.version = static_cast<std::uint64_t>(stamp_ns_);
    return result;
  }

  /// The colour of the line on top of a wall.
  static Color line_color(std::uint64_t id) {
    const Color body = color_of(id);
    return {0.8F * body.r, 0.8F * body.g, 0.8F * body.b};
  }

  Color color(const Eigen::Vector2d& p_m) const { return color_at(picture(), p_m); }

  std::int64_t stamp_ns_ = 10'000'000'000;
};

TEST_F(DisplayTest, DrawsTheEllipseWhereItIsUntilTheMapIsEmpty) {
  const Ellipse ellipse{{1.5, -0.75}, 0.5, 0.9, 0.4};
  publish(whole(body(5, ellipse)));
  ASSERT_TRUE(until([this] { return status() == "1 elements"; })) << status().toStdString();
  Ogre::Image image = picture();
  const Blob blob = blob_of(image, color_of(std::uint64_t{5}));
  EXPECT_NEAR(blob.area_m2, M_PI * 0.9 * 0.4, 0.05);
  EXPECT_NEAR(blob.center_m.x(), 1.5, 0.03);
  EXPECT_NEAR(blob.center_m.y(), -0.75, 0.03);
  const Eigen::Vector2d major(std::cos(0.5), std::sin(0.5)), minor(-std::sin(0.5), std::cos(0.5));
  EXPECT_TRUE(alike(color_at(image, ellipse.center_m + 0.8 * major), color_of(std::uint64_t{5})));
  EXPECT_FALSE(alike(color_at(image, ellipse.center_m + 0.8 * minor), color_of(std::uint64_t{5})));

  publish(whole(std::vector<Feature>{}));
  ASSERT_TRUE(until([this] { return status() == "0 elements"; }));
  EXPECT_EQ(blob_of(picture(), color_of(std::uint64_t{5})).area_m2, 0.0);
}

TEST_F(DisplayTest, FollowsTheTransformOfTheMapsFrame) {
  publish(whole(body(5, {{0.0, 0.0}, 0.0, 0.5, 0.5})), "odom");
  ASSERT_TRUE(until([this] { return status() == "1 elements"; })) << status().toStdString();
  const Blob blob = blob_of(picture(), color_of(std::uint64_t{5}));
  EXPECT_NEAR(blob.center_m.x(), 0.0, 0.03);
  EXPECT_NEAR(blob.center_m.y(), 1.0, 0.03);
}

TEST_F(DisplayTest, ShowsThePathUntilItIsReset) {
  for (int i = 0; i <= 20; ++i) {
    publish(whole(body(5, {{-2.0 + 0.2 * i, 0.5}, 0.0, 0.3, 0.3})));
    QTest::qWait(20);
  }
  ASSERT_TRUE(until([this] { return status() == "1 elements"; }));
  Ogre::Image image = picture();
  EXPECT_TRUE(alike(color_at(image, {2.0, 0.5}), color_of(std::uint64_t{5})));
  const Color background = color_at(image, {0.0, -2.0});
  const auto strength = [&](double x_m) {
    const Color color = color_at(image, {x_m, 0.5});
    return std::abs(color.r - background.r) + std::abs(color.g - background.g) + std::abs(color.b - background.b);
  };
  EXPECT_GT(strength(1.0), 0.2F);
  EXPECT_GT(strength(1.0), strength(-0.5));
  EXPECT_GT(strength(-0.5), strength(-1.8));

  display_->reset();
  image = picture();
  for (const double x_m : {2.0, 1.0, -0.5}) EXPECT_TRUE(alike(color_at(image, {x_m, 0.5}), background)) << x_m;
}

TEST_F(DisplayTest, ShowsMovingAndStandingBodies) {
  display_->subProp("Color")->setValue("standing or moving");
  std::vector<Feature> bodies{body(1, {{-1.0, 0.0}, 0.0, 0.4, 0.4}), body(2, {{1.0, 0.0}, 0.0, 0.4, 0.4}, {0.0, 1.5})};
  bodies[1].p_moving = 0.95;
  publish(whole(bodies));
  ASSERT_TRUE(until([this] { return status() == "2 elements"; }));
  Ogre::Image image = picture();
  EXPECT_TRUE(alike(color_at(image, {-1.0, 0.0}), kStandingColor));
  EXPECT_TRUE(alike(color_at(image, {1.0, 0.0}), kMovingColor));
  const Color background = color_at(image, {0.0, -2.0});
  EXPECT_FALSE(alike(color_at(image, {1.0, 1.0}), background)) << "the arrow of what moves";
  EXPECT_TRUE(alike(color_at(image, {-1.0, 1.0}), background));
  display_->subProp("Velocity")->setValue(false);
  EXPECT_TRUE(alike(color_at(picture(), {1.0, 1.0}), background));
}

TEST_F(DisplayTest, DrawsAndRemovesHundreds) {
  display_->subProp("IDs")->setValue(true);
  display_->subProp("Uncertainty")->setValue(true);
  for (int frame = 0; frame < 20; ++frame) {
    std::vector<Feature> bodies;
    for (int i = 0; i < (frame % 2 == 0 ? 500 : 250); ++i) {
      bodies.push_back(
          body(static_cast<FeatureId>(i + 1), {{0.5 * (i % 25) - 6.0, 0.5 * (i / 25) - 5.0}, 0.1, 0.2, 0.1}));
    }
    publish(whole(bodies));
    QTest::qWait(30);
  }
  ASSERT_TRUE(until([this] { return status() == "250 elements"; }));
  publish(whole(std::vector<Feature>{}));
  ASSERT_TRUE(until([this] { return status() == "0 elements"; }));
  Ogre::Image image = picture();
  const Color background = color_at(image, {4.5, 3.5});
  std::size_t drawn = 0;
  for (std::size_t row = 0; row < image.getHeight(); ++row) {
    for (std::size_t column = 0; column < image.getWidth(); ++column) {
      const Ogre::ColourValue color = image.getColourAt(column, row, 0);
      if (!alike({color.r, color.g, color.b}, background)) ++drawn;
    }
  }
  EXPECT_EQ(drawn, 0U);
}

TEST_F(DisplayTest, DrawsEachKindWhereItIsAndFollowsTheUpdates) {
  const double quarter = std::tan(kPi / 8.0);  // bulge of a quarter of a circle
  const Eigen::Vector2d circle_m(2.5, 1.5);
  std::vector<SplinegonVertex> arcs;
  for (const Eigen::Vector2d& way :
       {Eigen::Vector2d(1.0, 0.0), Eigen::Vector2d(0.0, 1.0), Eigen::Vector2d(-1.0, 0.0), Eigen::Vector2d(0.0, -1.0)}) {
    arcs.push_back({circle_m + way, quarter, 0.01, false});
  }
  const Feature body = feature(1, EllipseShape{{{-2.0, 0.0}, 0.0, 0.5, 0.5}, {}});
  const Feature box = feature(2, BoxShape{{{0.0, 1.5}, 0.0, 0.8, 0.4}, {}});
  const Feature wall = feature(3, PolylineShape{{{{-3.0, -2.0}, 0.01}, {{3.0, -2.0}, 0.01}}, false});
  const Feature boundary = feature(4, ArcShape{arcs, true});
  const Feature target = feature(5, FootprintShape{{2.5, -0.5, 0.0}, 1e-6 * Eigen::Matrix2d::Identity(), 1.0});
  publish(delta(0, {body, box, wall, boundary, target}));
  ASSERT_TRUE(until([this] { return status() == "5 elements"; })) << status().toStdString();
  const Ogre::Image image = picture();
  const Color background = color_at(image, {0.0, 0.0});
  EXPECT_TRUE(alike(color_at(image, {-2.0, 0.0}), color_of(std::uint64_t{1})));
  EXPECT_TRUE(alike(color_at(image, {0.6, 1.7}), color_of(std::uint64_t{2})));
  EXPECT_GT(blob_of(image, line_color(3)).area_m2, 0.5 * 6.0 * 0.03);
  EXPECT_NEAR(blob_of(image, line_color(4)).center_m.x(), circle_m.x(), 0.1);
  EXPECT_TRUE(alike(color_at(image, circle_m), background)) << "a boundary is a line";
  EXPECT_FALSE(alike(color_at(image, {2.5, -0.5}), background)) << "the target";

  // The body moves, the box becomes a line under the same id, and the target is gone.
  const Feature moved = feature(1, EllipseShape{{{-2.0, 1.0}, 0.0, 0.5, 0.5}, {}});
  const Feature line = feature(2, PolylineShape{{{{-1.0, 1.5}, 0.01}, {{1.0, 1.5}, 0.01}}, false});
  publish(delta(1, {moved, line}, {{5, GoneReason::kLeft, {}}}));
  ASSERT_TRUE(until([this] { return status() == "4 elements"; })) << status().toStdString();
  EXPECT_TRUE(alike(color({-2.0, 1.0}), color_of(std::uint64_t{1})));
  EXPECT_TRUE(alike(color({-2.0, -0.2}), background));
  EXPECT_TRUE(alike(color({0.6, 1.7}), background));
  EXPECT_TRUE(alike(color({2.5, -0.5}), background));

  // An update that was missed is mended by a whole map.
  publish(delta(7, {body}));
  ASSERT_TRUE(until([this] { return status().startsWith("not drawn: an update was missed"); }));
  EXPECT_TRUE(alike(color({-2.0, 1.0}), color_of(std::uint64_t{1})));
  publish(whole(body));
  ASSERT_TRUE(until([this] { return status() == "1 elements"; })) << status().toStdString();
  EXPECT_TRUE(alike(color({-2.0, 0.0}), color_of(std::uint64_t{1})));
}

TEST_F(DisplayTest, RefusesWhatARendererCannotTakeAndContinues) {
  const Feature wall = feature(3, PolylineShape{{{{-3.0, -2.0}, 0.01}, {{3.0, -2.0}, 0.01}}, false});
  Feature far = wall, vague = wall;
  std::get<PolylineShape>(far.shape).vertices[1].p_world_m.x() = 1e300;
  std::get<PolylineShape>(vague.shape).vertices[1].sigma_m = 1e12;
  for (const Feature& bad : {far, vague}) {
    publish(whole(bad));
    ASSERT_TRUE(until([this] { return status().startsWith("not drawn: feature 3: "); })) << status().toStdString();
    publish(whole(wall));
    ASSERT_TRUE(until([this] { return status() == "1 elements"; })) << status().toStdString();
    display_->reset();
  }
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) { return situation_awareness::run_display_tests(argc, argv, "rviz_display_test"); }
