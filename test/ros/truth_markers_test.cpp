// SPDX-License-Identifier: BSD-3-Clause
// The truth as markers: each object as it is, where it is.
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sim/world_file.hpp"
#include "situation_awareness/ros/markers/truth_markers.hpp"

namespace situation_awareness::truth_markers_test {
namespace {

using visualization_msgs::Marker;

/// A post, a box that turns on a circle, a triangular prism whose corner is its origin and that turns about it, and a
/// crate that is there for some time.
const std::string kYard =
    world_text(kRobot + R"(<body name="post" pos="-2 1 1" euler="0 0 0.3">
                  <geom type="ellipsoid" group="1" size="0.2 0.4 1"/> </body>
                <body name="box" mocap="true" pos="0 0 1" euler="0 0 0.2">
                  <geom type="box" group="1" size="0.5 0.3 1"/> </body>
                <body name="kiosk" mocap="true" pos="3 -2 0"> <geom type="mesh" group="1" mesh="kiosk"/> </body>
                <body name="crate" pos="5 5 1"> <geom type="box" group="1" size="0.1 0.1 1"/> </body>)",
               R"(<text name="box" data="circle center 2 3 radius 1.5 rate 0.7 spin 0.9"/>
       <text name="kiosk" data="straight from 3 -2 velocity 0.4 0.1 spin -0.6"/>
       <text name="crate" data="stand appears 2 goes 4"/>)",
               R"(<asset> <mesh name="kiosk" vertex="0 0 0  2 0 0  1 1.5 0  0 0 3  2 0 3  1 1.5 3"/> </asset>)");

Pose2 T_world_box(double t) {
  return {Eigen::Vector2d(2.0 + 1.5 * std::cos(0.7 * t), 3.0 + 1.5 * std::sin(0.7 * t)), 0.2 + 0.9 * t};
}

Pose2 T_world_kiosk(double t) { return {Eigen::Vector2d(3.0 + 0.4 * t, -2.0 + 0.1 * t), -0.6 * t}; }

class TruthOfAYard : public testing::Test {
 protected:
  visualization_msgs::MarkerArray at(double t) {
    return markers_.update(world_.objects_at(t), world_.names(), 1.5, "map", 1'000'000'000);
  }

  std::optional<Marker> marker_at(double t, const std::string& ns, const std::string& object) {
    const auto place = std::find(world_.names().begin(), world_.names().end(), object) - world_.names().begin();
    for (const Marker& marker : at(t).markers) {
      if (marker.action == Marker::ADD && marker.ns == ns && marker.id == place + 1) return marker;
    }
    return std::nullopt;
  }

  /// The vertices of the object's outline in the world, without the closing one.
  std::vector<Eigen::Vector2d> outline_at(double t, const std::string& object) {
    const Marker marker = marker_at(t, "object", object).value();
    EXPECT_EQ(marker.type, Marker::LINE_STRIP);
    EXPECT_EQ(marker.header.frame_id, "map");
    EXPECT_EQ(marker.header.stamp, ros::Time(1.0));
    EXPECT_EQ(marker.points.front(), marker.points.back()) << "closed";
    const auto& pose = marker.pose;
    const Eigen::Isometry3d T_world_marker =
        Eigen::Translation3d(pose.position.x, pose.position.y, pose.position.z) *
        Eigen::Quaterniond(pose.orientation.w, pose.orientation.x, pose.orientation.y, pose.orientation.z);
    std::vector<Eigen::Vector2d> vertices_world;
    for (std::size_t i = 0; i + 1 < marker.points.size(); ++i) {
      const Eigen::Vector3d p_world =
          T_world_marker * Eigen::Vector3d(marker.points[i].x, marker.points[i].y, marker.points[i].z);
      EXPECT_GT(p_world.z(), 1.5) << "over the map";
      vertices_world.push_back(p_world.head<2>());
    }
    return vertices_world;
  }

  WorldFile file_{kYard};
  World world_{file_.path()};
  TruthMarkers markers_;
};

TEST_F(TruthOfAYard, OutlinesABoxByItsRimUnderAnyRigidMotion) {
  const Eigen::Vector2d half(0.5, 0.3);
  for (const double t : {0.0, 0.4, 1.3, 2.9, 7.7}) {
    const std::vector<Eigen::Vector2d> vertices = outline_at(t, "box");
    ASSERT_EQ(vertices.size(), 4U);
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d p_box = inverse(T_world_box(t)) * vertices[i];
      EXPECT_LT((p_box.cwiseAbs() - half).norm(), 1e-9) << t << ": a corner";
      const Eigen::Vector2d middle_box = inverse(T_world_box(t)) * (0.5 * (vertices[i] + vertices[(i + 1) % 4]));
      EXPECT_NEAR((middle_box.cwiseAbs().array() / half.array()).maxCoeff(), 1.0, 1e-9) << t << ": a side";
      EXPECT_GT((vertices[i] - vertices[(i + 1) % 4]).norm(), 0.5);
    }
  }
}

TEST_F(TruthOfAYard, OutlinesAMeshByItsSectionUnderAnyRigidMotion) {
  const std::vector<Eigen::Vector2d> section = {{0.0, 0.0}, {2.0, 0.0}, {1.0, 1.5}};
  for (const double t : {0.0, 1.1, 6.0}) {
    const std::vector<Eigen::Vector2d> vertices = outline_at(t, "kiosk");
    ASSERT_EQ(vertices.size(), 3U);
    for (const Eigen::Vector2d& corner : section) {
      const Eigen::Vector2d p_world = T_world_kiosk(t) * corner;
      EXPECT_EQ(std::count_if(vertices.begin(), vertices.end(),
                              [&](const Eigen::Vector2d& vertex) { return (vertex - p_world).norm() < 1e-6; }),
                1)
          << t << ' ' << corner.transpose();
    }
  }
}

TEST_F(TruthOfAYard, OutlinesAnEllipseByPointsOnIt) {
  const std::vector<Eigen::Vector2d> vertices = outline_at(0.0, "post");
  EXPECT_GT(vertices.size(), 20U);
  for (const Eigen::Vector2d& p_world : vertices) {
    const Eigen::Vector2d p_post = inverse(Pose2{{-2.0, 1.0}, 0.3}) * p_world;
    EXPECT_NEAR(std::hypot(p_post.x() / 0.2, p_post.y() / 0.4), 1.0, 1e-9);
  }
}

TEST_F(TruthOfAYard, HasTheMotionOfTheOutlinesCentreAsAnArrow) {
  const auto center = [&](double t, const std::string& object) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    const std::vector<Eigen::Vector2d> vertices = outline_at(t, object);
    for (const Eigen::Vector2d& vertex : vertices) sum += vertex;
    return Eigen::Vector2d(sum / static_cast<double>(vertices.size()));
  };
  for (const std::string object : {"box", "kiosk"}) {
    for (const double t : {0.5, 3.0}) {
      const Marker arrow = marker_at(t, "velocity", object).value();
      ASSERT_EQ(arrow.points.size(), 2U);
      const Eigen::Vector2d from(arrow.points[0].x, arrow.points[0].y), to(arrow.points[1].x, arrow.points[1].y);
      constexpr double kStep_s = 1e-4;
      EXPECT_LT((from - center(t, object)).norm(), 1e-9) << object;
      EXPECT_LT(((to - from) - (center(t + kStep_s, object) - center(t - kStep_s, object)) / (2.0 * kStep_s)).norm(),
                1e-6)
          << object;
    }
  }
  EXPECT_FALSE(marker_at(0.5, "velocity", "post"));
}

TEST_F(TruthOfAYard, NamesThoseThatAreThereAndDeletesThoseThatHaveGone) {
  for (const std::string object : {"post", "box", "kiosk"}) EXPECT_EQ(marker_at(1.0, "id", object)->text, object);
  EXPECT_FALSE(marker_at(1.0, "object", "crate"));
  EXPECT_FALSE(marker_at(1.9, "id", "crate"));
  EXPECT_TRUE(marker_at(2.0, "object", "crate"));
  EXPECT_EQ(marker_at(3.9, "id", "crate")->text, "crate");
  int deleted = 0;
  for (const Marker& marker : at(4.0).markers) {
    if (marker.action != Marker::DELETE) continue;
    EXPECT_EQ(marker.id, 4);
    ++deleted;
  }
  EXPECT_EQ(deleted, 2) << "object and id";
  EXPECT_FALSE(marker_at(5.0, "object", "crate"));
}

}  // namespace
}  // namespace situation_awareness::truth_markers_test
