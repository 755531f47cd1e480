// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/map/objects/objects.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Result for a hit.
enum class HitFate : std::uint8_t {
  kObject,     ///< in a segment with a detection
  kRefused,    ///< in a segment of kind kObject without a detection
  kStructure,  ///< in a segment of kind kStructure
  kNoSegment,  ///< in no segment: noise, or outside the range or volume of interest
};

/// "object", "refused", "structure", "no segment".
const char* name_of(HitFate fate);

struct HitLabel {
  HitFate fate = HitFate::kNoSegment;
  std::uint8_t reason = 0;      ///< index in hit_reasons(), 0 for kObject
  std::uint64_t object_id = 0;  ///< of the object by which the detection is refined, or on which it is; 0: none
  std::size_t segment = kNoSegmentIndex;  ///< index in Segments::segments

  static constexpr std::size_t kNoSegmentIndex = static_cast<std::size_t>(-1);
};

/// One label for each of Segments::points. `detections` are those of `segments`, and `known` is the map by which they
/// were refined: that before the scan. `memory`: as for limit_range. Throws std::invalid_argument if a detection or a
/// refused segment has an index out of range.
std::vector<HitLabel> label_hits(const Segments& segments, const Detections& detections, const Objects& known,
                                 std::vector<HitLabel> memory = {});

/// All reasons why a hit is on no object; the first is empty, the last is "other". Clouds contain the index.
const std::vector<const char*>& hit_reasons();

/// Index in hit_reasons(); that of "other" for an unknown text.
std::uint8_t hit_reason_index(const char* why);

}  // namespace situation_awareness
