// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "situation_awareness/ros/markers/object_markers.hpp"

namespace situation_awareness {
namespace {

using visualization_msgs::Marker;

Object object(std::uint64_t id, double speed_m_s = 0.0) {
  Object result;
  result.id = id;
  result.ellipse_world = {{1.0, 2.0}, 0.5, 0.4, 0.2};
  result.velocity_world_m_s = {speed_m_s, 0.0};
  result.covariance = Matrix8d::Identity() * 1e-4;
  return result;
}

Objects map_of(std::vector<Object> objects) {
  Objects result;
  result.stamp_ns = 1'000'000'000;
  result.height_world_m = 1.0;
  result.objects = std::move(objects);
  return result;
}

/// The markers shown after all these messages.
class Viewer {
 public:
  void receive(const visualization_msgs::MarkerArray& array) {
    for (const Marker& marker : array.markers) {
      const auto key = std::make_pair(marker.ns, marker.id);
      if (marker.action == Marker::ADD) {
        shown.insert(key);
      } else if (marker.action == Marker::DELETE) {
        EXPECT_EQ(shown.erase(key), 1U) << marker.ns << ' ' << marker.id;
      } else {
        ++clears;
        shown.clear();
      }
    }
  }

  std::set<int> ids(const std::string& name) const {
    std::set<int> result;
    for (const auto& [ns, id] : shown) {
      if (ns == name) result.insert(id);
    }
    return result;
  }

  std::set<std::pair<std::string, int>> shown;
  int clears = 0;
};

const Marker& find(const visualization_msgs::MarkerArray& array, const std::string& name) {
  for (const Marker& marker : array.markers) {
    if (marker.ns == name) return marker;
  }
  throw std::runtime_error("no marker " + name);
}

TEST(ObjectMarkers, DrawTheMapAndNothingElse) {
  ObjectMarkers markers;
  Viewer viewer;
  viewer.receive(markers.update(map_of({object(1), object(2, 1.0), object(3)}), "world"));
  EXPECT_EQ(viewer.ids("object"), (std::set<int>{1, 2, 3}));
  EXPECT_EQ(viewer.ids("velocity"), (std::set<int>{2})) << "only what moves";
  EXPECT_EQ(viewer.ids("id"), (std::set<int>{1, 2, 3}));
  EXPECT_EQ(viewer.ids("position_uncertainty"), (std::set<int>{1, 2, 3}));

  viewer.receive(markers.update(map_of({object(2), object(3), object(9)}), "world"));
  EXPECT_EQ(viewer.ids("object"), (std::set<int>{2, 3, 9}));
  EXPECT_EQ(viewer.ids("velocity"), std::set<int>{}) << "2 stopped";
  EXPECT_EQ(viewer.ids("id"), (std::set<int>{2, 3, 9}));
  EXPECT_EQ(viewer.ids("position_uncertainty"), (std::set<int>{2, 3, 9}));

  viewer.receive(markers.update(map_of({}), "world"));
  EXPECT_TRUE(viewer.shown.empty());
  EXPECT_EQ(viewer.clears, 1) << "only once, for what an earlier run left";
}

TEST(ObjectMarkers, EllipseAndUncertaintyHaveTheirSizes) {
  ObjectMarkers markers;
  Object one = object(5);
  one.covariance(0, 0) = 0.04;  // sigma 0.2 m along x, 0.01 m along y
  const auto array = markers.update(map_of({one}), "world");
  const Marker& body = find(array, "object");
  EXPECT_EQ(body.header.frame_id, "world");
  EXPECT_EQ(body.header.stamp, ros::Time(1.0));
  EXPECT_DOUBLE_EQ(body.scale.x, 0.8);
  EXPECT_DOUBLE_EQ(body.scale.y, 0.4);
  EXPECT_DOUBLE_EQ(2.0 * std::atan2(body.pose.orientation.z, body.pose.orientation.w), 0.5);
  const Marker& area = find(array, "position_uncertainty");
  EXPECT_NEAR(area.scale.x, 2.0 * 2.4477 * 0.2, 1e-3);
  EXPECT_NEAR(area.scale.y, 2.0 * 2.4477 * 0.01, 1e-3);
  EXPECT_NEAR(std::sin(2.0 * std::atan2(area.pose.orientation.z, area.pose.orientation.w)), 0.0, 1e-9);
}

TEST(ObjectMarkers, ABoxIsACubeOfItsSides) {
  ObjectMarkers markers;
  Object one = object(5);
  one.shape = Shape::kBox;
  one.box_world = {{1.0, 2.0}, 0.75, 0.5, 0.25};
  one.ellipse_world = moment_equal_ellipse(one.box_world);
  const Marker body = find(markers.update(map_of({one}), "world"), "object");
  EXPECT_EQ(body.type, Marker::CUBE);
  EXPECT_DOUBLE_EQ(body.scale.x, 1.0);
  EXPECT_DOUBLE_EQ(body.scale.y, 0.5);
  EXPECT_DOUBLE_EQ(body.pose.position.x, 1.0);
  EXPECT_DOUBLE_EQ(body.pose.position.y, 2.0);
  EXPECT_DOUBLE_EQ(2.0 * std::atan2(body.pose.orientation.z, body.pose.orientation.w), 0.75);
  one.shape = Shape::kEllipse;
  EXPECT_EQ(find(markers.update(map_of({one}), "world"), "object").type, Marker::CYLINDER);
}

TEST(ObjectMarkers, TheClassIsATextBesideTheId) {
  ObjectMarkers markers;
  Object one = object(5);
  EXPECT_EQ(find(markers.update(map_of({one}), "world"), "id").text, "5");
  one.object_class = ObjectClass::kPerson;
  one.p_class = 0.934;
  EXPECT_EQ(find(markers.update(map_of({one}), "world"), "id").text, "5 person 93 %");
}

TEST(ObjectMarkers, SurviveAnUnknownPosition) {
  ObjectMarkers markers;
  Object one = object(5);
  one.covariance.setZero();
  one.covariance(0, 0) = -1e-18;  // rounding
  const Marker area = find(markers.update(map_of({one}), "world"), "position_uncertainty");
  EXPECT_TRUE(std::isfinite(area.scale.x) && area.scale.x > 0.0);
  EXPECT_TRUE(std::isfinite(area.scale.y) && area.scale.y > 0.0);
}

}  // namespace
}  // namespace situation_awareness
