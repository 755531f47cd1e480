// SPDX-License-Identifier: BSD-3-Clause
// Why images over an elevation give nothing.
#include "situation_awareness/pipeline/ground_in_view.hpp"

#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace situation_awareness::ground_in_view_test {
namespace {

std::shared_ptr<const Elevation> level(double height_m, double west_m = -100.0) {
  return std::make_shared<Elevation>(50, 50, Eigen::Vector2d(west_m, 100.0), Eigen::Vector2d(4.0, 4.0),
                                     std::vector<float>(2500, static_cast<float>(height_m)));
}

Eigen::Isometry3d looking(const Eigen::Vector3d& from_m, const Eigen::Vector3d& at_m) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  const Eigen::Vector3d z = (at_m - from_m).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  T.linear() << x, z.cross(x), z;
  T.translation() = from_m;
  return T;
}

/// Directions near a point are of the class.
SoftLabels labels_of(const Eigen::Isometry3d& T_world_camera, const std::vector<Eigen::Vector3d>& things_world_m) {
  SoftLabels labels;
  labels.camera = {60, 60, 60.0, 60.0, 29.5, 29.5};
  labels.probability.assign(3600, 0.0F);
  for (const Eigen::Vector3d& thing : things_world_m) {
    const Eigen::Vector3d p = T_world_camera.inverse() * thing;
    if (p.z() <= 0.0) continue;
    const auto u = std::lround(60.0 * p.x() / p.z() + 29.5), v = std::lround(60.0 * p.y() / p.z() + 29.5);
    for (auto r = std::max(v - 1, 0L); r <= std::min(v + 1, 59L); ++r) {
      for (auto c = std::max(u - 2, 0L); c <= std::min(u + 2, 59L); ++c) {
        labels.probability[static_cast<std::size_t>(60 * r + c)] = 1.0F;
      }
    }
  }
  return labels;
}

constexpr GridUpdate kSeen{100, 5};

/// Fourteen images from places around the origin at a height, of cars on ground of height 0.
GroundInView around(double elevation_m,
                    const std::vector<Eigen::Vector3d>& cars = {{3.0, 2.0, 0.7}, {-6.0, 4.0, 0.7}}) {
  GroundInView view(level(elevation_m), 220.0);
  for (int k = 0; k < 14; ++k) {
    const double angle = 0.2 * k;
    const auto T = looking({35.0 * std::cos(angle), 35.0 * std::sin(angle), 25.0}, Eigen::Vector3d::Zero());
    view.add(labels_of(T, cars), T, kSeen);
  }
  return view;
}

TEST(GroundInView, TellsTheHeightAtWhichImagesAgree) {
  for (const double elevation_m : {-120.0, -47.0, -12.0, 8.0, 15.0}) {
    const GroundInView view = around(elevation_m);
    ASSERT_TRUE(view.agreed_height_m()) << elevation_m;
    EXPECT_NEAR(*view.agreed_height_m(), -elevation_m, 4.0);
    EXPECT_NE(view.why_no_target().find(elevation_m < 0.0 ? "m above the elevation" : "m below the elevation"),
              std::string::npos);
    EXPECT_EQ(view.why_none(), "");
  }
}

TEST(GroundInView, TellsAHeightThatMakesTargetsWrongToHalfAMetre) {
  for (const double elevation_m : {-21.0, -5.0, -3.5, 3.5, 6.0}) {
    const GroundInView view = around(elevation_m);
    ASSERT_NE(view.why_wrong_targets(), "") << elevation_m;
    EXPECT_EQ(view.why_wrong_targets(), view.why_no_target());
    EXPECT_NEAR(*view.agreed_height_m(), -elevation_m, 0.6);
  }
  for (const double elevation_m : {-2.0, 0.0, 2.0}) EXPECT_EQ(around(elevation_m).why_wrong_targets(), "");
}

TEST(GroundInView, TellsAHeightAlsoOfThingsThatFewImagesShow) {
  std::vector<Eigen::Vector3d> cars;
  for (int k = 0; k < 12; ++k) cars.emplace_back(-70.0 + 13.0 * k, k % 3 == 0 ? 9.0 : -4.0 * (k % 3), 0.7);
  for (const double elevation_m : {-9.0, -4.0, 0.0, 4.0, 9.0}) {
    GroundInView view(level(elevation_m), 220.0);
    for (int k = 0; k < 16; ++k) {
      const Eigen::Vector3d from(-80.0 + 9.0 * k, 25.0 * (k % 2 == 0 ? 1.0 : -1.0), 22.0);
      const auto T = looking(from, {from.x() + 4.0, 0.0, 0.0});
      view.add(labels_of(T, cars), T, kSeen);
    }
    if (elevation_m == 0.0) {
      EXPECT_EQ(view.why_wrong_targets(), "");
      continue;
    }
    ASSERT_NE(view.why_wrong_targets(), "") << elevation_m;
    EXPECT_NEAR(*view.agreed_height_m(), -elevation_m, 0.6);
  }
}

TEST(GroundInView, SaysNothingOfHeightsWhereTheyAreRight) {
  EXPECT_EQ(around(0.0).why_no_target(), "");
  EXPECT_EQ(around(1.5).why_no_target(), "");
}

TEST(GroundInView, WhatIsElsewhereInEachImageHasNoHeight) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> place(-12.0, 12.0);
    GroundInView view(level(0.0), 220.0);
    for (int k = 0; k < 14; ++k) {
      const double angle = 0.2 * k;
      const auto T = looking({35.0 * std::cos(angle), 35.0 * std::sin(angle), 25.0}, Eigen::Vector3d::Zero());
      const Eigen::Vector3d one(place(random), place(random), 0.0), other(place(random), place(random), 0.0);
      view.add(labels_of(T, {one, other}), T, kSeen);
    }
    EXPECT_EQ(view.why_no_target(), "") << seed;
  }
}

TEST(GroundInView, ACameraThatStandsTellsNoHeight) {
  GroundInView view(level(-30.0), 220.0);
  const auto T = looking({30.0, 0.0, 25.0}, Eigen::Vector3d::Zero());
  for (int k = 0; k < 100; ++k) view.add(labels_of(T, {{3.0, 2.0, 0.7}}), T, kSeen);
  EXPECT_EQ(view.why_no_target(), "");
}

TEST(GroundInView, NamesBothPlaces) {
  const auto says = [](const std::shared_ptr<const Elevation>& elevation, const Eigen::Isometry3d& T, double reach_m) {
    GroundInView view(elevation, reach_m);
    EXPECT_EQ(view.why_none(), "");
    view.add(labels_of(T, {}), T, GridUpdate{});
    return view.why_none();
  };
  const auto T = looking({0.0, 0.0, 20.0}, {20.0, 0.0, 0.0});
  const std::string elsewhere = says(level(3.0, 5000.0), looking({0.0, 0.0, 23.0}, {20.0, 0.0, 3.0}), 220.0);
  EXPECT_NE(elsewhere.find("x 5000 to 5200, y -100 to 100, z 3 to 3 m"), std::string::npos) << elsewhere;
  EXPECT_NE(elsewhere.find("(0.0, 0.0, 23.0) looks at (20.0, "), std::string::npos) << elsewhere;
  EXPECT_NE(says(level(30.0), T, 220.0).find("10.0 m below the elevation"), std::string::npos);
  EXPECT_NE(says(level(0.0), T, 15.0).find("20 m away, beyond grid/reach_m 15"), std::string::npos);
  EXPECT_NE(says(level(0.0), looking({0.0, 0.0, 20.0}, {20.0, 0.0, 40.0}), 220.0).find("45 deg above the horizon"),
            std::string::npos);
  EXPECT_NE(says(level(std::numeric_limits<double>::quiet_NaN()), T, 220.0).find("no height"), std::string::npos);
}

TEST(GroundInView, TellsOfTheLatestImageWhyItTellsNothing) {
  GroundInView view(level(0.0), 220.0);
  const auto T = looking({0.0, 0.0, 20.0}, {20.0, 0.0, 0.0});
  view.add(labels_of(T, {}), T, kSeen);
  EXPECT_EQ(view.why_not_latest(), "");
  view.add(labels_of(T, {}), T, GridUpdate{});
  EXPECT_EQ(view.why_not_latest(), "no known ground in view");
  SoftLabels unknown = labels_of(T, {});
  unknown.probability.assign(unknown.probability.size(), 0.5F);
  view.add(unknown, T, GridUpdate{});
  EXPECT_EQ(view.why_not_latest(), "no label is known");
  EXPECT_EQ(view.why_none(), "");
}

TEST(GroundInView, TellsThatNoLabelIsOnTheElevation) {
  GroundInView beside(level(0.0), 220.0), without(level(0.0), 220.0);
  const auto T = looking({0.0, 0.0, 20.0}, {20.0, 0.0, 0.0});
  for (int k = 0; k < 8; ++k) {
    beside.add(labels_of(T, {{19.0, 3.0, 0.0}}), T, GridUpdate{100, 0});
    without.add(labels_of(T, {}), T, GridUpdate{100, 0});
  }
  EXPECT_NE(beside.why_no_target().find("8 of 8 images show the class, and none of them on known ground"),
            std::string::npos);
  EXPECT_NE(beside.why_no_target().find("looks at (20.0"), std::string::npos);
  EXPECT_EQ(without.why_no_target(), "");
}

TEST(GroundInView, KnowsWhereAGroundIsOfWhichItHasNoPart) {
  GroundInView view(level(0.0), 220.0);
  view.set_elevation(level(std::numeric_limits<double>::quiet_NaN()),
                     Eigen::AlignedBox3d(Eigen::Vector3d(5000.0, 0.0, 3.0), Eigen::Vector3d(5200.0, 100.0, 3.0)));
  view.set_remedy("give the origin");
  const auto T = looking({0.0, 0.0, 23.0}, {20.0, 0.0, 3.0});
  view.add(labels_of(T, {}), T, GridUpdate{});
  EXPECT_NE(view.why_none().find("x 5000 to 5200, y 0 to 100, z 3 to 3 m"), std::string::npos) << view.why_none();
  EXPECT_NE(view.why_none().find("; give the origin"), std::string::npos);
}

TEST(GroundInView, KnowsNoLabel) {
  GroundInView view(level(0.0), 220.0);
  const auto T = looking({0.0, 0.0, 20.0}, {20.0, 0.0, 0.0});
  SoftLabels labels = labels_of(T, {});
  for (std::size_t i = 0; i < labels.probability.size(); ++i) {
    labels.probability[i] = i % 2 == 0 ? 0.5F : std::numeric_limits<float>::quiet_NaN();
  }
  view.add(labels, T, GridUpdate{});
  EXPECT_EQ(view.why_none().find("no label of 1 images is known"), 0U);
}

}  // namespace
}  // namespace situation_awareness::ground_in_view_test
