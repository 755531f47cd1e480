// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/detector.hpp"

#include <utility>

#include "situation_awareness/common/usual_room.hpp"

namespace situation_awareness {

Detections Detector::detect(const Segments& segments, Detections memory, const std::vector<char>* not_asked) {
  Detections found = std::move(memory);
  found.stamp_ns = segments.stamp_ns;
  found.T_world_level = segments.T_world_level;
  found.height_world_m = segments.height_world_m;
  found.free_space = segments.free_space;
  found.detections.clear();
  found.detections.reserve(kUsualRoom);
  found.refused.reset();
  found.refused_segments.clear();
  found.refused_segments.reserve(kUsualRoom);
  not_asked_ = not_asked;
  find(segments, found);
  not_asked_ = nullptr;
  found.small_segments = small_segments(segments, found, std::move(found.small_segments));
  return found;
}

}  // namespace situation_awareness
