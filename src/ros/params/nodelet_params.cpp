// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/nodelet_params.hpp"

#include <stdexcept>

#include "situation_awareness/ros/convert/poses.hpp"

namespace situation_awareness {

std::string checked_world_frame(const std::string& world_frame, const std::string& source) {
  std::string frame = tf2_frame(world_frame);
  if (frame.empty()) throw std::invalid_argument(source + ": world_frame is empty");
  return frame;
}

}  // namespace situation_awareness
