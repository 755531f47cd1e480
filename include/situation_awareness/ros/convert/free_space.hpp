// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>

#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// Into the common fields of SegmentArray and DetectionArray.
template <class Message>
void free_space_to_msg(const FreeSpace& free_space, Message& msg) {
  msg.free_azimuth = free_space.azimuth_rad;
  msg.free_range = free_space.range_m;
  msg.free_full_circle = static_cast<std::uint8_t>(free_space.full_circle);
}

/// Throws std::invalid_argument if there is not one range for each azimuth, azimuths are not finite, decrease or are
/// many turns away, or a range is NaN or negative.
template <class Message>
FreeSpace free_space_from_msg(const Message& msg) {
  if (msg.free_azimuth.size() != msg.free_range.size()) {
    throw std::invalid_argument("free space has not one range for each azimuth");
  }
  constexpr float kMaxAzimuth_rad = 100.0F;  // it is wrapped by turns
  for (std::size_t i = 0; i < msg.free_azimuth.size(); ++i) {
    if (!(std::abs(msg.free_azimuth[i]) < kMaxAzimuth_rad) ||
        (i > 0 && msg.free_azimuth[i] < msg.free_azimuth[i - 1])) {
      throw std::invalid_argument("an azimuth of free space is not that of a beam, or steps back");
    }
    if (!(msg.free_range[i] >= 0.0F)) throw std::invalid_argument("a range of free space is not a number >= 0");
  }
  return {msg.free_azimuth, msg.free_range, msg.free_full_circle != 0};
}

}  // namespace situation_awareness
