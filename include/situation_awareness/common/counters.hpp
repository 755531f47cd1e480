// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace situation_awareness {

/// How often something happened, by reason. Reasons are short fixed texts that diagnostics print as they are.
using Counters = std::map<std::string, std::uint64_t>;

}  // namespace situation_awareness
