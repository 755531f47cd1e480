// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/check/report.hpp"

#include "situation_awareness/common/format.hpp"

namespace situation_awareness {

void add_defects(const Counters& defects, std::size_t all, const char* noun, const char* remedy, TopicReport& report) {
  for (const auto& [reason, count] : defects) {
    report.findings.push_back({formatted("%llu of %zu %s cannot be used: %s", static_cast<unsigned long long>(count),
                                         all, noun, reason.c_str()),
                               remedy});
  }
}

}  // namespace situation_awareness
