// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/map_history.hpp"

#include <gtest/gtest.h>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness::map_history_test {
namespace {

void add(MapHistory& history, double stamp_s, const std::vector<std::pair<std::uint64_t, double>>& ids_and_x,
         double length_s) {
  std::vector<MapPosition> elements;
  for (const auto& [id, x_m] : ids_and_x) elements.push_back({id, {x_m, 0.0}});
  history.add(nanoseconds(stamp_s), elements, length_s);
}

TEST(MapHistory, HoldsThePathOfTheLatestSeconds) {
  MapHistory history;
  for (int i = 0; i <= 100; ++i) add(history, 100.0 + 0.1 * i, {{7, 0.05 * i}}, 2.0);
  const auto& path = history.path(7);
  ASSERT_EQ(path.size(), 21U);
  EXPECT_NEAR(path.front().position_m.x(), 4.0, 1e-9);
  EXPECT_NEAR(path.back().position_m.x(), 5.0, 1e-9);
  for (std::size_t i = 1; i < path.size(); ++i) EXPECT_GT(path[i].stamp_ns, path[i - 1].stamp_ns);
}

TEST(MapHistory, EndsAtTheElementAndGathersNoPointsWhileItStands) {
  MapHistory history;
  for (int i = 0; i <= 1000; ++i) add(history, 0.05 * i, {{7, 1.0 + 0.003 * (i % 2)}}, 100.0);
  EXPECT_LE(history.path(7).size(), 2U);
  EXPECT_EQ(history.path(7).back().position_m.x(), 1.0);
}

TEST(MapHistory, IsDeletedWithItsElement) {
  MapHistory history;
  add(history, 1.0, {{7, 0.0}, {8, 5.0}}, 10.0);
  add(history, 2.0, {{7, 1.0}, {8, 6.0}}, 10.0);
  add(history, 3.0, {{8, 7.0}}, 10.0);
  EXPECT_TRUE(history.path(7).empty());
  EXPECT_EQ(history.path(8).size(), 3U);
  add(history, 4.0, {{7, 2.0}, {8, 8.0}}, 10.0);
  EXPECT_EQ(history.path(7).size(), 1U);
  add(history, 5.0, {}, 10.0);
  EXPECT_TRUE(history.path(8).empty());
}

TEST(MapHistory, StartsAgainWhereTimeGoesBack) {
  MapHistory history;
  add(history, 10.0, {{7, 0.0}}, 100.0);
  add(history, 11.0, {{7, 1.0}}, 100.0);
  add(history, 5.0, {{7, 2.0}}, 100.0);
  ASSERT_EQ(history.path(7).size(), 1U);
  EXPECT_EQ(history.path(7).front().position_m.x(), 2.0);
}

TEST(MapHistory, IsBoundedHoweverLongItIs) {
  MapHistory history;
  for (int i = 0; i < 10'000; ++i) add(history, 0.01 * i, {{7, 0.1 * i}}, 1e6);
  EXPECT_EQ(history.path(7).size(), 2000U);
}

}  // namespace
}  // namespace situation_awareness::map_history_test
