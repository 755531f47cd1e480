// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/map/free_space_memory.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Tells which detections are where a scan of the last seconds saw free space: what is there has come there. Unlike the
/// way of an estimate, this free-space violation (Schmid et al., Dynablox, RA-L 2023) does not mistake for motion that
/// more of a thing comes into view.
class Arrivals {
 public:
  /// Sets Detection::has_arrived of those detections with a hidden end; the motion of the others shows without it. To
  /// be called for each scan, in the order of the stamps.
  Detections mark(const Segments& segments, Detections detections);

 private:
  static constexpr double kStep_s = 0.5;
  static constexpr std::size_t kScans = 8;

  FreeSpaceMemory memory_{kStep_s, kScans};
  std::vector<Eigen::Vector2d> hits_world_m_;  ///< kept for its memory
};

}  // namespace situation_awareness
