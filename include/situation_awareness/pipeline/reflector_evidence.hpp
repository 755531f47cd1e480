// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/points/point_states.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/pose/reflectors.hpp"

namespace situation_awareness {

/// What scans show of reflectors, to tell why there is no pose or survey by them.
class ReflectorEvidence {
 public:
  explicit ReflectorEvidence(const ReflectorDetectionParams& params) : params_(params) { clear(); }

  /// The points of a scan and what was detected in them.
  void add(const Points& points, const ReflectorSightings& sightings);
  void clear();

  /// Why no scan so far shows a reflector, in one sentence: "the brightest beam is 240, below reflectors/min_intensity
  /// 430". Empty if one does, and without scans.
  std::string why_none() const;

  /// The greatest number in one scan.
  std::size_t most_sightings() const { return most_sightings_; }

 private:
  ReflectorDetectionParams params_;
  PointStates states_;
  std::uint64_t beams_ = 0;  ///< hits with an intensity
  float brightest_ = 0.0F, dimmest_ = 0.0F;
  std::size_t most_sightings_ = 0;
  Counters refused_;
};

}  // namespace situation_awareness
