// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>

namespace situation_awareness {

/// Greatest number of scans or hits that a map counts, and that a file may have: a map can count on from there.
constexpr int kMaxCount = 1 << 30;

/// Adds to a count from 0 to kMaxCount, which stays there. `more` is at least 0.
inline void count_more(int& count, int more = 1) { count += std::min(more, kMaxCount - count); }

}  // namespace situation_awareness
