// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/assignment.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness {
namespace {

double cost_of(const std::vector<int>& column_of, const std::vector<Candidate>& candidates, double cost_unmatched) {
  double total = 0.0;
  for (std::size_t row = 0; row < column_of.size(); ++row) {
    double cost = cost_unmatched;
    for (const Candidate& candidate : candidates) {
      if (candidate.row == static_cast<int>(row) && candidate.column == column_of[row]) cost = candidate.cost;
    }
    total += cost;
  }
  return total;
}

/// Best cost over every one-to-one choice, by trying them all.
double best_cost(int row, int rows, std::set<int>& taken, const std::vector<Candidate>& candidates,
                 double cost_unmatched) {
  if (row == rows) return 0.0;
  double best = cost_unmatched + best_cost(row + 1, rows, taken, candidates, cost_unmatched);
  for (const Candidate& candidate : candidates) {
    if (candidate.row != row || taken.count(candidate.column) != 0) continue;
    taken.insert(candidate.column);
    best = std::min(best, candidate.cost + best_cost(row + 1, rows, taken, candidates, cost_unmatched));
    taken.erase(candidate.column);
  }
  return best;
}

TEST(Assignment, IsAsCheapAsTheBestOfAllChoices) {
  Random random(7);
  for (int trial = 0; trial < 300; ++trial) {
    const int rows = 1 + static_cast<int>(random.uniform() * 6);
    const int columns = 1 + static_cast<int>(random.uniform() * 6);
    const double density = random.uniform();
    std::vector<Candidate> candidates;
    for (int i = 0; i < rows; ++i) {
      for (int j = 0; j < columns; ++j) {
        if (random.uniform() < density) candidates.push_back({i, j, random.uniform(0.0, 10.0)});
      }
    }
    const std::vector<int> column_of = assign(rows, columns, candidates, 11.0);
    std::set<int> taken;
    for (const int column : column_of) {
      if (column < 0) continue;
      EXPECT_TRUE(taken.insert(column).second) << "column used twice";
    }
    taken.clear();
    EXPECT_NEAR(cost_of(column_of, candidates, 11.0), best_cost(0, rows, taken, candidates, 11.0), 1e-9);
  }
}

TEST(Assignment, TakesTheBetterPairsNotTheNearestFirst) {
  // Greedy takes (0, 0) at 1 and leaves row 1 alone.
  const std::vector<Candidate> candidates{{0, 0, 1.0}, {0, 1, 2.0}, {1, 0, 2.0}};
  EXPECT_EQ(assign(2, 2, candidates, 10.0), (std::vector<int>{1, 0}));
}

TEST(Assignment, WithoutCandidatesMatchesNothing) {
  EXPECT_EQ(assign(2, 3, {}, 1.0), (std::vector<int>{-1, -1}));
  EXPECT_TRUE(assign(0, 0, {}, 1.0).empty());
}

}  // namespace
}  // namespace situation_awareness
