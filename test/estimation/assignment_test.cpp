// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/assignment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <set>
#include <vector>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness::assignment_test {
namespace {

/// Sum of the costs of the matched pairs; infinite if one is no candidate of negative cost.
double cost_of(const std::vector<int>& column_of, const std::vector<Candidate>& candidates) {
  double total = 0.0;
  for (std::size_t row = 0; row < column_of.size(); ++row) {
    if (column_of[row] < 0) continue;
    const auto pair = std::find_if(candidates.begin(), candidates.end(), [&](const Candidate& candidate) {
      return candidate.row == static_cast<int>(row) && candidate.column == column_of[row] && candidate.cost < 0.0;
    });
    total += pair != candidates.end() ? pair->cost : std::numeric_limits<double>::infinity();
  }
  return total;
}

/// Least cost over all matchings of these candidates, by trying every one.
double least_cost(const std::vector<Candidate>& candidates, std::size_t from = 0, std::set<int> rows = {},
                  std::set<int> columns = {}) {
  if (from == candidates.size()) return 0.0;
  const Candidate& candidate = candidates[from];
  const double without = least_cost(candidates, from + 1, rows, columns);
  if (!rows.insert(candidate.row).second || !columns.insert(candidate.column).second) return without;
  return std::min(without, candidate.cost + least_cost(candidates, from + 1, rows, columns));
}

/// Candidates among `rows` and `columns`, numbered from `first_row` and `first_column` on.
std::vector<Candidate> random_candidates(int rows, int columns, Random& random, int first_row = 0,
                                         int first_column = 0) {
  const double density = random.uniform();
  const double dearest = random.uniform(-2.0, 8.0);
  std::vector<Candidate> candidates;
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      if (random.uniform() >= density) continue;
      candidates.push_back({first_row + i, first_column + j, random.uniform(-10.0, dearest)});
    }
  }
  return candidates;
}

int up_to(int most, Random& random) { return 1 + static_cast<int>(random.uniform() * most); }

TEST(Assignment, IsAsCheapAsTheBestOfAllMatchings) {
  Random random(7);
  for (int trial = 0; trial < 500; ++trial) {
    const int rows = up_to(4, random);
    const int columns = up_to(4, random);
    const std::vector<Candidate> candidates = random_candidates(rows, columns, random);
    const std::vector<int> column_of = assign(rows, columns, candidates);
    std::set<int> taken;
    for (const int column : column_of) {
      if (column < 0) continue;
      EXPECT_TRUE(taken.insert(column).second) << "column used twice";
    }
    EXPECT_NEAR(cost_of(column_of, candidates), least_cost(candidates), 1e-9);
  }
}

TEST(Assignment, ASeparateGroupOfRowsAndColumnsChangesNothing) {
  Random random(8);
  for (int trial = 0; trial < 500; ++trial) {
    const int rows = up_to(6, random);
    const int columns = up_to(6, random);
    const std::vector<Candidate> here = random_candidates(rows, columns, random);
    const int other_rows = up_to(6, random);
    const int other_columns = up_to(6, random);
    std::vector<Candidate> all = random_candidates(other_rows, other_columns, random, rows, columns);
    for (Candidate& candidate : all) candidate.cost *= 100.0;
    all.insert(random.uniform() < 0.5 ? all.begin() : all.end(), here.begin(), here.end());

    std::vector<int> column_of = assign(rows + other_rows, columns + other_columns, all);
    column_of.resize(static_cast<std::size_t>(rows));
    EXPECT_EQ(column_of, assign(rows, columns, here)) << trial;
  }
}

TEST(Assignment, IsTheSameOfRowsAndColumnsExchanged) {
  Random random(9);
  for (int trial = 0; trial < 200; ++trial) {
    const int rows = up_to(40, random);
    const int columns = up_to(6, random);
    const std::vector<Candidate> candidates = random_candidates(rows, columns, random);
    std::vector<Candidate> exchanged = candidates;
    for (Candidate& candidate : exchanged) std::swap(candidate.row, candidate.column);
    const std::vector<int> column_of = assign(rows, columns, candidates);
    const std::vector<int> row_of = assign(columns, rows, exchanged);
    for (int row = 0; row < rows; ++row) {
      const int column = column_of[static_cast<std::size_t>(row)];
      if (column < 0) continue;
      EXPECT_EQ(row_of[static_cast<std::size_t>(column)], row) << trial;
    }
    const auto unmatched = [](const std::vector<int>& of) { return std::count(of.begin(), of.end(), -1); };
    EXPECT_EQ(rows - unmatched(column_of), columns - unmatched(row_of)) << trial;
  }
}

TEST(Assignment, IsOptimalAndNotGreedy) {
  // Greedy takes (0, 0) at -9 and leaves row 1 unmatched.
  const std::vector<Candidate> candidates{{0, 0, -9.0}, {0, 1, -8.0}, {1, 0, -8.0}};
  EXPECT_EQ(assign(2, 2, candidates), (std::vector<int>{1, 0}));
}

TEST(Assignment, LeavesARowUnmatchedWhereThatIsCheaperThanTwoPoorPairs) {
  const std::vector<Candidate> candidates{{0, 0, -9.0}, {0, 1, -4.0}, {1, 0, -4.0}};
  EXPECT_EQ(assign(2, 2, candidates), (std::vector<int>{0, -1}));
}

TEST(Assignment, MatchesNoPairThatIsNoBetterThanNone) {
  EXPECT_EQ(assign(2, 3, {}), (std::vector<int>{-1, -1}));
  EXPECT_TRUE(assign(0, 0, {}).empty());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(assign(3, 3, {{0, 0, 0.0}, {1, 1, 1.0}, {2, 2, nan}, {2, 1, nan}}), (std::vector<int>{-1, -1, -1}));
}

}  // namespace
}  // namespace situation_awareness::assignment_test
