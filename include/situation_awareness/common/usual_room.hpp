// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace situation_awareness {

/// Room that lists get which are short after most scans, when they are first used: else the first scan with more would
/// allocate, at any time.
constexpr std::size_t kUsualRoom = 128;

}  // namespace situation_awareness
