// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <string>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

/// By how much the stamp of one message of a recording is wrong, in s.
constexpr std::array<double, 7> kStampShifts_s = {-3600.0, -5.0, -0.2, 0.2, 2.0, 5.0, 3600.0};

/// What is done to one message of a stream: its stamp is moved, or it is left out.
struct WrongStamp {
  std::string stream;
  int message = -1;  ///< of the stream, from 0 on
  double shift_s = 0.0;
  bool is_left_out = false;

  bool leaves_out(const std::string& of_stream, int i) const {
    return is_left_out && i == message && of_stream == stream;
  }
  /// Its stamp.
  std::int64_t operator()(const std::string& of_stream, int i, std::int64_t stamp_ns) const {
    return i == message && of_stream == stream ? stamp_ns + nanoseconds(shift_s) : stamp_ns;
  }
};

/// The name of the fault in the table of wrong stamps.
inline std::string stamp_fault(double shift_s) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "stamp %+g s", shift_s);
  return text.data();
}

}  // namespace situation_awareness
