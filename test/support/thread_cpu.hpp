// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ctime>

namespace situation_awareness {

/// Time of the processor that this thread has taken (us): whatever else runs beside it.
inline double thread_cpu_us() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e6 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_nsec);
}

}  // namespace situation_awareness
