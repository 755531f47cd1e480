// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

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

}  // namespace situation_awareness
