// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdint>
#include <set>
#include <string>
#include <variant>

#include <gtest/gtest.h>

#include "situation_awareness/map/map.hpp"
#include "situation_awareness/ros/markers/map_markers.hpp"
#include "situation_awareness/ros/markers/object_markers.hpp"
#include "situation_awareness/ros/markers/polygon_markers.hpp"
#include "situation_awareness/ros/markers/shown_markers.hpp"
#include "situation_awareness/ros/markers/splinegon_markers.hpp"

namespace situation_awareness::markers_test {
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

/// Markers of successive maps of one layer, as MapMarkers shows those of all.
template <class Layer>
class LayerMarkers {
 public:
  visualization_msgs::MarkerArray update(const Layer& layer, const std::string& world_frame) {
    return shown_.update(make_header(world_frame, layer.stamp_ns), markers_of(layer, world_frame));
  }

 private:
  static std_msgs::Header make_header(const std::string& frame, std::int64_t stamp_ns) {
    std_msgs::Header header;
    header.frame_id = frame;
    header.stamp.fromNSec(static_cast<std::uint64_t>(stamp_ns));
    return header;
  }

  ShownMarkers shown_;
};

TEST(ObjectMarkers, DrawTheMapAndNothingElse) {
  LayerMarkers<Objects> markers;
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
  LayerMarkers<Objects> markers;
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
  LayerMarkers<Objects> markers;
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
  LayerMarkers<Objects> markers;
  Object one = object(5);
  EXPECT_EQ(find(markers.update(map_of({one}), "world"), "id").text, "5");
  one.object_class = ObjectClass::kPerson;
  one.p_class = 0.934;
  EXPECT_EQ(find(markers.update(map_of({one}), "world"), "id").text, "5 person 93 %");
}

TEST(ObjectMarkers, SurviveAnUnknownPosition) {
  LayerMarkers<Objects> markers;
  Object one = object(5);
  one.covariance.setZero();
  one.covariance(0, 0) = -1e-18;  // rounding
  const Marker area = find(markers.update(map_of({one}), "world"), "position_uncertainty");
  EXPECT_TRUE(std::isfinite(area.scale.x) && area.scale.x > 0.0);
  EXPECT_TRUE(std::isfinite(area.scale.y) && area.scale.y > 0.0);
}

Polygons two_chains() {
  Polygons polygons;
  polygons.stamp_ns = 1'000'000'000;
  polygons.height_world_m = 0.5;
  polygons.chains.push_back(
      {3, false, {{{2.0, 3.0}, 0.01}, {{-2.0, 3.0}, 0.02}, {{-2.0, 1.0}, 0.02}}, 0, 0, 1.0, ChainState::kWall});
  polygons.chains.push_back({5, true, {{{0.0, 0.0}, 0.01}, {{0.0, 1.0}, 0.01}, {{1.0, 1.0}, 0.01}}, 0, 0, 1.0});
  return polygons;
}

TEST(PolygonMarkers, OneMarkerHasAllEdgesOfAState) {
  LayerMarkers<Polygons> markers;
  Polygons polygons = two_chains();
  const auto array = markers.update(polygons, "map");
  const Marker wall = find(array, "wall");
  EXPECT_EQ(wall.header.frame_id, "map");
  ASSERT_EQ(wall.points.size(), 4U) << "two edges";
  EXPECT_EQ(wall.points[1].x, -2.0);
  EXPECT_EQ(wall.points[1].z, 0.5);
  const Marker fresh = find(array, "new");
  ASSERT_EQ(fresh.points.size(), 6U) << "closed";
  EXPECT_EQ(fresh.points[5].x, 0.0);
  EXPECT_EQ(fresh.points[5].y, 0.0);
  // Bars of 2 sigma to both sides, across the first edge.
  const Marker bars = find(array, "uncertainty");
  ASSERT_EQ(bars.points.size(), 12U);
  EXPECT_NEAR(bars.points[0].x, bars.points[1].x, 1e-12);
  EXPECT_NEAR(std::abs(bars.points[0].y - bars.points[1].y), 0.04, 1e-12);
  // A chain that changes its state leaves nothing of the one before.
  polygons.chains[1].state = ChainState::kKnown;
  const auto next = markers.update(polygons, "map");
  EXPECT_EQ(find(next, "known").points.size(), 6U);
  EXPECT_EQ(find(next, "new").action, Marker::DELETE);
  // And without chains all go.
  polygons.chains.clear();
  for (const Marker& marker : markers.update(polygons, "map").markers) EXPECT_EQ(marker.action, Marker::DELETE);
}

/// A round tower as four quarters of a circle, counter-clockwise.
Splinegons round_tower(double radius_m, double sigma_m) {
  Splinegons splinegons;
  splinegons.stamp_ns = 1'000'000'000;
  splinegons.height_world_m = 15.0;
  Splinegon tower;
  tower.id = 7;
  tower.closed = true;
  const double bulge = std::tan(std::atan(1.0) / 2.0);  // of 90 degrees
  for (const auto& [x, y] : {std::pair(1.0, 0.0), {0.0, 1.0}, {-1.0, 0.0}, {0.0, -1.0}}) {
    tower.vertices.push_back({radius_m * Eigen::Vector2d(x, y), bulge, sigma_m, false});
  }
  splinegons.boundaries.push_back(tower);
  return splinegons;
}

TEST(SplinegonMarkers, DrawTheArcsAndTheEnvelopeBesideThem) {
  constexpr double kRadius_m = 8.0, kSigma_m = 0.3;
  LayerMarkers<Splinegons> markers;
  Splinegons splinegons = round_tower(kRadius_m, kSigma_m);
  const auto array = markers.update(splinegons, "world");
  const Marker closed = find(array, "closed");
  ASSERT_GT(closed.points.size(), 40U);
  for (std::size_t i = 0; i < closed.points.size(); ++i) {
    EXPECT_NEAR(std::hypot(closed.points[i].x, closed.points[i].y), kRadius_m, 1e-9);
    EXPECT_EQ(closed.points[i].z, 15.0);
    if (i % 2 == 1 && i + 1 < closed.points.size()) {
      EXPECT_EQ(closed.points[i].x, closed.points[i + 1].x);
    }
  }
  EXPECT_EQ(closed.points.front().x, closed.points.back().x) << "it closes";
  const Marker envelope = find(array, "envelope");
  ASSERT_EQ(envelope.points.size() % 3, 0U);
  for (const geometry_msgs::Point& p : envelope.points) {
    EXPECT_NEAR(std::abs(std::hypot(p.x, p.y) - kRadius_m), 2.5758293 * kSigma_m, 1e-6);
  }
  EXPECT_EQ(find(array, "id").text, "7");
  // Once it is known to be open, nothing is left of the closed one.
  splinegons.boundaries[0].closed = false;
  splinegons.boundaries[0].vertices.pop_back();
  splinegons.boundaries[0].vertices.back().bulge = 0.0;
  const auto next = markers.update(splinegons, "world");
  EXPECT_EQ(find(next, "closed").action, Marker::DELETE);
  EXPECT_EQ(find(next, "open").action, Marker::ADD);
  splinegons.boundaries.clear();
  for (const Marker& marker : markers.update(splinegons, "world").markers) EXPECT_EQ(marker.action, Marker::DELETE);
}

TEST(MapMarkers, AThingThatBecomesOneOfAnotherKindKeepsItsLabel) {
  Feature body, wall;
  body.id = 7;
  body.shape = EllipseShape{{{1.0, 2.0}, 0.5, 0.4, 0.2}, {}};
  wall.id = 8;
  wall.shape = PolylineShape{{{{-3.0, -2.0}, 0.01}, {{3.0, -2.0}, 0.01}}, false};
  Feature parked = body;
  parked.shape = PolylineShape{{{{0.6, 2.0}, 0.01}, {{1.4, 2.0}, 0.01}}, false};
  MapMarkers markers;
  Viewer viewer;
  for (const Feature& seven : {body, parked, body}) {
    viewer.receive(markers.update({1'000'000'000, 0, 1.0, {seven, wall}}, "world"));
    EXPECT_EQ(viewer.ids("id"), std::set<int>({7, 8}));
    EXPECT_EQ(viewer.ids("object").count(7), std::holds_alternative<EllipseShape>(seven.shape) ? 1U : 0U);
  }
  viewer.receive(markers.update({1'100'000'000, 0, 1.0, {}}, "world"));
  EXPECT_TRUE(viewer.shown.empty());
  EXPECT_EQ(viewer.clears, 1);
}

}  // namespace
}  // namespace situation_awareness::markers_test
