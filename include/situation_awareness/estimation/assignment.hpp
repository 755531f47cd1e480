// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace situation_awareness {

/// A pair that may be matched, and what that costs against leaving both alone.
struct Candidate {
  int row = 0;
  int column = 0;
  double cost = 0.0;  ///< finite; only a pair of negative cost is ever matched
};

/// The one-to-one matching of rows to columns with the least sum of the costs of its pairs, where leaving rows and
/// columns alone costs nothing: optimal, not greedy (global nearest neighbour association: Blackman and Popoli, 1999).
///
/// Rows and columns that no chain of candidates of negative cost connects are solved apart. So what is matched among
/// some does not depend on what else there is, and the time grows linearly with the number of such groups and with the
/// cube only of the largest (shortest augmenting paths: Jonker and Volgenant, 1987). Returns for each row its column,
/// or -1; in `memory`, a result no longer needed.
std::vector<int> assign(int rows, int columns, const std::vector<Candidate>& candidates, std::vector<int> memory = {});

}  // namespace situation_awareness
