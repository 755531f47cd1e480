// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/pace.hpp"

#include <algorithm>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

void Pace::handled(double duration_s) {
  durations_s_[next_] = duration_s;
  next_ = (next_ + 1) % durations_s_.size();
  count_ = std::min(count_ + 1, durations_s_.size());
}

double Pace::duration_s() const {
  if (count_ == 0) return 0.0;
  std::array<double, 5> sorted = durations_s_;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(count_ / 2);
  std::nth_element(sorted.begin(), middle, sorted.begin() + static_cast<std::ptrdiff_t>(count_));
  return *middle;
}

std::size_t Pace::passed_over(std::size_t waiting, std::int64_t oldest_stamp_ns, std::int64_t newest_stamp_ns) const {
  if (waiting < 2) return 0;
  const double period_s = seconds_between(oldest_stamp_ns, newest_stamp_ns) / static_cast<double>(waiting - 1);
  const bool in_time = static_cast<double>(waiting) * duration_s() <= period_s;
  return in_time ? 0 : waiting - 1;
}

}  // namespace situation_awareness
