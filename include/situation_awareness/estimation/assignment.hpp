// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace situation_awareness {

/// A pair that may be matched, and what that costs.
struct Candidate {
  int row = 0;
  int column = 0;
  double cost = 0.0;  ///< 0 <= cost < cost_unmatched
};

/// The one-to-one matching of rows to columns that minimises the sum of the costs of the matched candidates plus
/// `cost_unmatched` for each row left alone: as many cheap pairs as fit together, optimal, not greedy.
///
/// Rows and columns that no chain of candidates connects are solved apart, so the time grows linearly with the number
/// of such groups and with the cube only of the largest (shortest augmenting paths: Jonker and Volgenant, 1987).
/// Returns for each row its column, or -1; in `memory`, a result no longer needed.
std::vector<int> assign(int rows, int columns, const std::vector<Candidate>& candidates, double cost_unmatched,
                        std::vector<int> memory = {});

}  // namespace situation_awareness
