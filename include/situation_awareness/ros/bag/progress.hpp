// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>

namespace situation_awareness {

/// Progress of a program on stderr: on a terminal one updated line, in a log one line per 10 %.
class Progress {
 public:
  /// `noun`: what is counted, such as "scans".
  Progress(std::size_t total, std::string noun);

  void at(std::size_t done);

 private:
  std::size_t total_;
  std::string noun_;
  bool terminal_;
  int step_percent_;
  int shown_percent_ = -1;
};

}  // namespace situation_awareness
