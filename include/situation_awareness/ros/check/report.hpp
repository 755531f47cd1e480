// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "situation_awareness/common/counters.hpp"

namespace situation_awareness {

/// What in a recording contradicts itself, or is needed by a map and is not there.
struct Finding {
  std::string what;    ///< one sentence without a full stop
  std::string remedy;  ///< what to do about it
};

/// What is known of one topic of a recording.
struct TopicReport {
  std::string topic, type;
  std::vector<std::string> facts;  ///< a line each
  std::vector<Finding> findings;
};

/// Appends a finding for each reason why messages cannot be used; `noun`: what they are called.
void add_defects(const Counters& defects, std::size_t all, const char* noun, const char* remedy, TopicReport& report);

}  // namespace situation_awareness
