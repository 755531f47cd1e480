// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/grid/grid.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

namespace situation_awareness::grid_test {
namespace {

/// Rows from the north, as one reads them: '#' of the class, '.' not, ' ' not observed.
SemanticGrid grid_of(const std::vector<std::string>& rows) {
  SemanticGrid grid;
  grid.cell_m = 2.0;
  grid.first_column = -5;
  grid.first_row = 10;
  grid.width = static_cast<int>(rows[0].size());
  grid.height = static_cast<int>(rows.size());
  for (auto row = rows.rbegin(); row != rows.rend(); ++row) {
    for (const char c : *row) {
      grid.probability.push_back(c == '#' ? 0.9F : c == '.' ? 0.1F : std::numeric_limits<float>::quiet_NaN());
      grid.images.push_back(c == ' ' ? 0 : 5);
      grid.class_images.push_back(c == '#' ? static_cast<int>(grid.class_images.size()) : 0);
      grid.class_latest.push_back(grid.class_images.back());
      grid.ground_world_m.push_back(3.0F);
    }
  }
  grid.latest = 1;
  return grid;
}

TEST(FindClusters, TakesCellsThatTouchByAnEdgeOrACornerTogether) {
  std::vector<GridCluster> clusters;
  find_clusters(grid_of({"#..#",  //
                         ".#. ",  //
                         "....",  //
                         "##.#"}),
                clusters);
  ASSERT_EQ(clusters.size(), 4U);  // in the order of rows from the south
  EXPECT_EQ(clusters[0].area_m2, 8.0);
  EXPECT_EQ(clusters[0].p_world_m, Eigen::Vector2d(-8.0, 21.0));
  EXPECT_EQ(clusters[0].images, 1);
  EXPECT_FLOAT_EQ(static_cast<float>(clusters[0].probability), 0.9F);
  EXPECT_EQ(clusters[0].ground_world_m, 3.0);
  EXPECT_EQ(clusters[1].area_m2, 4.0);
  EXPECT_EQ(clusters[2].area_m2, 8.0);
  EXPECT_EQ(clusters[2].p_world_m, Eigen::Vector2d(-8.0, 26.0));
  EXPECT_EQ(clusters[3].p_world_m, Eigen::Vector2d(-3.0, 27.0));
}

/// Clusters of '#', where the latest image shows the class on 'x'.
std::vector<GridCluster> clusters_shown(const std::vector<std::string>& rows, const std::vector<std::string>& shown) {
  SemanticGrid grid = grid_of(rows);
  grid.latest = 7;
  for (std::size_t row = 0; row < shown.size(); ++row) {
    for (std::size_t column = 0; column < shown[row].size(); ++column) {
      const std::size_t i = grid.index(static_cast<int>(column), grid.height - 1 - static_cast<int>(row));
      grid.class_latest[i] = shown[row][column] == 'x' ? 7 : 6;
    }
  }
  std::vector<GridCluster> clusters;
  find_clusters(grid, clusters);
  return clusters;
}

TEST(FindClusters, TellWhatTheLatestImageShowsApart) {
  const auto are_apart = [](const std::vector<std::string>& shown) {
    const std::vector<GridCluster> clusters = clusters_shown({"##..##", "##..##", "##..##"}, shown);
    EXPECT_EQ(clusters.size(), 2U);
    EXPECT_EQ(shown_apart(clusters.at(0), clusters.at(1)), shown_apart(clusters.at(1), clusters.at(0)));
    return shown_apart(clusters.at(0), clusters.at(1));
  };
  EXPECT_TRUE(are_apart({".x..x.", "......", "......"}));
  EXPECT_FALSE(are_apart({".xxxx.", "......", "......"}));  // one thing, on both
  EXPECT_TRUE(are_apart({"x.....", "......", ".xxxx."}));   // the same, and another
  EXPECT_FALSE(are_apart({"..x.x.", "......", "......"}));  // the first cluster is not shown
  EXPECT_FALSE(are_apart({"......", "......", "......"}));
  EXPECT_FALSE(are_apart({"x.....", "......", "x....."}));
}

TEST(FindClusters, OfNothingAreNone) {
  std::vector<GridCluster> clusters(3);
  find_clusters(SemanticGrid{}, clusters);
  EXPECT_TRUE(clusters.empty());
  find_clusters(grid_of({". .", "..."}), clusters);
  EXPECT_TRUE(clusters.empty());
}

}  // namespace
}  // namespace situation_awareness::grid_test
