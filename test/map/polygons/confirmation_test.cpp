// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "room_polylines.hpp"
#include "situation_awareness/map/polygons/polygon_map.hpp"

namespace situation_awareness::confirmation_test {
namespace {

constexpr std::int64_t kPeriod_ns = 25'000'000;  ///< of the whole recording: 40 Hz
constexpr double kEnd_s = 21.0, kTaken_s = 8.0, kStep_m = 0.02;
const Box kStands{{-1.5, -1.0}, 0.3, 0.3, 0.2}, kTakenAway{{-1.8, 0.3}, 0.0, 0.2, 0.2};

/// Up and down along one side of the room, never in one place.
Box walker_at(double t_s) {
  const double way_m = std::fmod(1.1 * t_s, 8.8);
  return {{std::abs(way_m - 4.4) - 2.2, 1.3}, 0.2, 0.12, 0.12};
}

/// A room in which a box stands, another one is taken away, and someone walks all the time.
std::vector<Polylines> recording() {
  RoomPolylines room(11);
  room.set_period(kPeriod_ns);
  room.add_box(kStands);
  std::vector<Polylines> scans;
  for (double t_s = 0.0; t_s <= kEnd_s; t_s += 1e-9 * kPeriod_ns) {
    room.add_box(walker_at(t_s));
    if (t_s < kTaken_s) room.add_box(kTakenAway);
    scans.push_back(room.next());
    if (t_s < kTaken_s) room.remove_box();
    room.remove_box();
  }
  return scans;
}

/// Returns the map of one in `every` of the scans.
Polygons map_of(const std::vector<Polylines>& scans, std::size_t every) {
  PolygonMap map({});
  for (std::size_t i = 0; i < scans.size(); i += every) {
    map.update(scans[i], Eigen::Matrix3d::Zero());
    map.update_due_chains();
  }
  return map.polygons();
}

/// Places on all chains, `kStep_m` apart.
std::vector<Eigen::Vector2d> places_on(const Polygons& polygons) {
  std::vector<Eigen::Vector2d> places;
  for (const Chain& chain : polygons.chains) {
    for (std::size_t i = 0; i + (chain.closed ? 0 : 1) < chain.vertices.size(); ++i) {
      const Eigen::Vector2d from_m = chain.vertices[i].p_world_m;
      const Eigen::Vector2d way_m = chain.vertices[(i + 1) % chain.vertices.size()].p_world_m - from_m;
      for (double at_m = 0.0; at_m < way_m.norm(); at_m += kStep_m)
        places.push_back(from_m + at_m * way_m.normalized());
    }
  }
  return places;
}

double distance_m(const Eigen::Vector2d& p_m, const std::vector<Eigen::Vector2d>& places) {
  double least_m = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector2d& place : places) least_m = std::min(least_m, (place - p_m).norm());
  return least_m;
}

/// Returns places on the outlines of all that stands at the end.
std::vector<Eigen::Vector2d> true_places() {
  Polygons truth;
  for (const Box& box : {Box{{0.0, 0.0}, 0.0, 3.0, 2.0}, kStands}) {
    Chain& chain = truth.chains.emplace_back();
    chain.closed = true;
    for (const Eigen::Vector2d& corner_m : corners(box)) chain.vertices.push_back({corner_m, 0.0});
  }
  return places_on(truth);
}

/// Whether the scanner looks 40 times in a second or once in 3.5 s, what stands is on the map, and nothing else.
TEST(Confirmation, OneRecordingAtAnyRateIsTheSameMap) {
  const std::vector<Polylines> scans = recording();
  const std::vector<Eigen::Vector2d> truth = true_places(), usual = places_on(map_of(scans, 2));
  ASSERT_GT(usual.size(), 0.9 * (20.0 + 0.7) / kStep_m);  // walls, and the sides of the box that are in view
  for (const std::size_t every : {1, 2, 5, 20, 70, 140}) {
    const std::vector<Eigen::Vector2d> mapped = places_on(map_of(scans, every));
    double worst_m = 0.0;
    for (const Eigen::Vector2d& p_m : mapped) worst_m = std::max(worst_m, distance_m(p_m, truth));
    EXPECT_LT(worst_m, 0.03) << "1 in " << every;
    const auto covered = std::count_if(usual.begin(), usual.end(),
                                       [&](const Eigen::Vector2d& p_m) { return distance_m(p_m, mapped) < 0.03; });
    EXPECT_GT(static_cast<double>(covered), 0.9 * static_cast<double>(usual.size())) << "1 in " << every;
  }
}

}  // namespace
}  // namespace situation_awareness::confirmation_test
