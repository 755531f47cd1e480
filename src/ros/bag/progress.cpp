// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/progress.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

namespace situation_awareness {

Progress::Progress(std::size_t total, std::string noun)
    : total_(std::max<std::size_t>(total, 1)),
      noun_(std::move(noun)),
      terminal_(isatty(STDERR_FILENO) != 0),
      step_percent_(terminal_ ? 1 : 10) {}

void Progress::at(std::size_t done) {
  const int percent = static_cast<int>(100 * done / total_);
  if (shown_percent_ >= 0 && percent / step_percent_ == shown_percent_ / step_percent_) return;
  shown_percent_ = percent;
  std::fprintf(stderr, terminal_ ? "\r%3d %% of %zu %s" : "%3d %% of %zu %s\n", percent, total_, noun_.c_str());
  if (terminal_ && percent == 100) std::fputc('\n', stderr);
}

}  // namespace situation_awareness
