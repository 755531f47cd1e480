// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/objects.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "situation_awareness/geometry/outline.hpp"

namespace situation_awareness::objects_test {
namespace {

TEST(Objects, AnObjectIsAnEllipseOfUnknownClassUnlessSaidOtherwise) {
  const Object object;
  EXPECT_STREQ(name_of(object.shape), "ellipse");
  EXPECT_EQ(object.p_shape, 1.0);
  EXPECT_STREQ(name_of(object.object_class), "unknown");
  EXPECT_EQ(object.p_class, 0.0);
}

TEST(Objects, TheOutlineOfABoxIsItsCorners) {
  Object object;
  object.shape = Shape::kBox;
  object.box_world = {{1.0, 2.0}, 0.3, 0.4, 0.2};
  object.ellipse_world = moment_equal_ellipse(object.box_world);
  const std::vector<Eigen::Vector2d> outline = outline_world(object);
  ASSERT_EQ(outline.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(outline[i], corners(object.box_world)[i]);
}

TEST(Objects, TheOutlineOfAnythingElseIsOnItsEllipse) {
  Object object;
  object.ellipse_world = {{1.0, 2.0}, 0.3, 0.4, 0.2};
  for (const Shape shape : {Shape::kEllipse, Shape::kCompact}) {
    object.shape = shape;
    const std::vector<Eigen::Vector2d> outline = outline_world(object);
    ASSERT_EQ(outline.size(), static_cast<std::size_t>(kOutlinePoints));
    const Outline ellipse = outline_of(object.ellipse_world);
    for (std::size_t i = 0; i < outline.size(); ++i) {
      EXPECT_NEAR(offset_m(ellipse, outline[i]), 0.0, 1e-12);
      const Eigen::Vector2d middle = 0.5 * (outline[i] + outline[(i + 1) % outline.size()]);
      EXPECT_NEAR(offset_m(ellipse, middle), 0.0, 0.005 * object.ellipse_world.rx_m);
    }
  }
}

}  // namespace
}  // namespace situation_awareness::objects_test
