// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/estimation/assignment.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

#include "situation_awareness/common/usual_room.hpp"

namespace situation_awareness {
namespace {

/// Memory reused from call to call.
struct AssignmentWorkspace {
  std::vector<int> parents;
  std::vector<int> group_of;
  std::vector<Candidate> sorted;
  std::vector<int> local_rows;
  std::vector<int> local_columns;
  std::vector<double> cost;
  std::vector<double> row_price;
  std::vector<double> column_price;
  std::vector<std::size_t> row_of;
  std::vector<double> distance;
  std::vector<std::size_t> previous;
  std::vector<char> done;
  std::vector<std::size_t> column_of;
};

/// Disjoint sets with path halving.
class Groups {
 public:
  Groups(int size, std::vector<int>& memory) : parent_(memory) {
    assign_with_room(parent_, static_cast<std::size_t>(size), 0);
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  int find(int i) {
    while (at(i) != i) i = at(i) = at(at(i));
    return i;
  }
  void join(int i, int j) { at(find(i)) = find(j); }

 private:
  int& at(int i) { return parent_[static_cast<std::size_t>(i)]; }
  std::vector<int>& parent_;
};

/// Minimum-cost assignment of every row of a dense rows x columns matrix `work.cost`, rows <= columns: each row's
/// column, into `work.column_of`.
void assign_dense(std::size_t rows, std::size_t columns, AssignmentWorkspace& work) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const std::size_t none = columns;
  const std::vector<double>& cost = work.cost;
  std::vector<double>& row_price = work.row_price;
  std::vector<double>& column_price = work.column_price;
  std::vector<std::size_t>& row_of = work.row_of;
  std::vector<double>& distance = work.distance;
  std::vector<std::size_t>& previous = work.previous;
  std::vector<char>& done = work.done;
  assign_with_room(row_price, rows, 0.0);
  assign_with_room(column_price, columns + 1, 0.0);
  assign_with_room(row_of, columns + 1, rows);  // the extra column holds the row being placed

  for (std::size_t row = 0; row < rows; ++row) {
    assign_with_room(distance, columns, kInfinity);
    assign_with_room(previous, columns, none);
    assign_with_room(done, columns + 1, 0);
    row_of[none] = row;
    std::size_t column = none;
    do {  // shortest path over reduced costs from the new row to a free column
      done[column] = 1;
      const std::size_t i = row_of[column];
      double step = kInfinity;
      std::size_t next = none;
      for (std::size_t j = 0; j < columns; ++j) {
        if (done[j] != 0) continue;
        const double reduced = cost[i * columns + j] - row_price[i] - column_price[j];
        if (reduced < distance[j]) {
          distance[j] = reduced;
          previous[j] = column;
        }
        if (distance[j] < step) {
          step = distance[j];
          next = j;
        }
      }
      for (std::size_t j = 0; j <= columns; ++j) {
        if (done[j] != 0) {
          row_price[row_of[j]] += step;
          column_price[j] -= step;
        } else if (j < columns) {
          distance[j] -= step;
        }
      }
      column = next;
    } while (row_of[column] != rows);
    while (column != none) {
      const std::size_t before = previous[column];
      row_of[column] = row_of[before];
      column = before;
    }
    row_of[none] = rows;
  }

  assign_with_room(work.column_of, rows, none);
  for (std::size_t j = 0; j < columns; ++j) {
    if (row_of[j] != rows) work.column_of[row_of[j]] = j;
  }
}

}  // namespace

std::vector<int> assign(int rows, int columns, const std::vector<Candidate>& candidates, std::vector<int> memory) {
  thread_local AssignmentWorkspace work;
  std::vector<Candidate>& sorted = work.sorted;
  sorted.clear();
  sorted.reserve(kUsualRoom);
  for (const Candidate& candidate : candidates) {
    if (candidate.cost < 0.0) sorted.push_back(candidate);  // nor NaN, with which the search would not end
  }
  Groups groups(rows + columns, work.parents);
  for (const Candidate& candidate : sorted) groups.join(candidate.row, rows + candidate.column);

  assign_with_room(work.group_of, static_cast<std::size_t>(rows), 0);
  for (int row = 0; row < rows; ++row) work.group_of[static_cast<std::size_t>(row)] = groups.find(row);
  const auto group = [](const Candidate& candidate) { return work.group_of[static_cast<std::size_t>(candidate.row)]; };
  std::sort(sorted.begin(), sorted.end(), [&](const Candidate& a, const Candidate& b) {
    return std::make_tuple(group(a), a.row, a.column) < std::make_tuple(group(b), b.row, b.column);
  });

  std::vector<int> result = std::move(memory);
  assign_with_room(result, static_cast<std::size_t>(rows), -1);
  std::vector<int>& local_rows = work.local_rows;
  std::vector<int>& local_columns = work.local_columns;
  local_rows.reserve(kUsualRoom);
  local_columns.reserve(kUsualRoom);
  std::vector<double>& cost = work.cost;
  cost.reserve(8 * kUsualRoom);  // a matrix
  for (auto begin = sorted.begin(); begin != sorted.end();) {
    const auto end = std::find_if(begin, sorted.end(), [&](const Candidate& c) { return group(c) != group(*begin); });
    local_rows.clear();
    local_columns.clear();
    for (auto c = begin; c != end; ++c) {
      local_rows.push_back(c->row);
      local_columns.push_back(c->column);
    }
    for (std::vector<int>* indices : {&local_rows, &local_columns}) {
      std::sort(indices->begin(), indices->end());
      indices->erase(std::unique(indices->begin(), indices->end()), indices->end());
    }
    const auto index = [](const std::vector<int>& indices, int value) {
      return static_cast<std::size_t>(std::lower_bound(indices.begin(), indices.end(), value) - indices.begin());
    };

    // Pairs that are no candidates cost nothing: what is assigned to such a one is unmatched. The smaller side is
    // placed on the larger one.
    const bool place_columns = local_columns.size() < local_rows.size();
    const std::vector<int>& placed = place_columns ? local_columns : local_rows;
    const std::vector<int>& places = place_columns ? local_rows : local_columns;
    const std::size_t n = placed.size();
    const std::size_t m = places.size();
    assign_with_room(cost, n * m, 0.0);
    for (auto c = begin; c != end; ++c) {
      const std::size_t i = index(placed, place_columns ? c->column : c->row);
      cost[i * m + index(places, place_columns ? c->row : c->column)] = c->cost;
    }
    assign_dense(n, m, work);
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t j = work.column_of[i];
      if (!(cost[i * m + j] < 0.0)) continue;
      const int row = place_columns ? places[j] : placed[i];
      result[static_cast<std::size_t>(row)] = place_columns ? placed[i] : places[j];
    }
    begin = end;
  }
  return result;
}

}  // namespace situation_awareness
