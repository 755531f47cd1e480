// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/json_line.hpp"

#include <array>
#include <cstdio>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

std::string json_line(std::int64_t stamp_ns, const Json& rest) {
  std::array<char, 40> stamp{};
  std::snprintf(stamp.data(), stamp.size(), "%lld.%09lld", static_cast<long long>(stamp_ns / kNanosecondsPerSecond),
                static_cast<long long>(stamp_ns % kNanosecondsPerSecond));
  std::string line = rest.dump();
  line.replace(0, 1, std::string("{\"stamp\":") + stamp.data() + ",");
  return line += '\n';
}

}  // namespace situation_awareness
