// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace situation_awareness {

/// A pair that may be matched, and its cost relative to leaving both unmatched.
struct Candidate {
  int row = 0;
  int column = 0;
  double cost = 0.0;  ///< finite; only a pair of negative cost is ever matched
};

/// The one-to-one matching of rows to columns with the least sum of the costs of its pairs, where unmatched rows and
/// columns cost nothing: optimal, not greedy (global nearest neighbour association: Blackman and Popoli, 1999).
///
/// Components of rows and columns connected by candidates of negative cost are solved separately. So the matching in
/// one does not depend on the others, and the time is linear in the number of components and cubic only in the size of
/// the largest (shortest augmenting paths: Jonker and Volgenant, 1987). Returns for each row its column, or -1; reuses
/// the memory of `memory`, a result no longer needed.
std::vector<int> assign(int rows, int columns, const std::vector<Candidate>& candidates, std::vector<int> memory = {});

}  // namespace situation_awareness
