// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "situation_awareness/common/json.hpp"

namespace situation_awareness {

/// One line: {"stamp":S, and the members of `rest`, an object that is not empty. The stamp is in seconds with all
/// digits of its nanoseconds, which a double cannot represent.
std::string json_line(std::int64_t stamp_ns, const Json& rest);

}  // namespace situation_awareness
