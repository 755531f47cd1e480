// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/hit_labels.hpp"

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "situation_awareness/detections/refine.hpp"
#include "situation_awareness/pipeline/unmapped_segments.hpp"

namespace situation_awareness {

const char* name_of(HitFate fate) {
  switch (fate) {
    case HitFate::kObject:
      return "object";
    case HitFate::kRefused:
      return "refused";
    case HitFate::kStructure:
      return "structure";
    case HitFate::kNoSegment:
      return "no segment";
  }
  return "";
}

std::vector<HitLabel> label_hits(const Segments& segments, const Detections& detections, const Objects& known,
                                 std::vector<HitLabel> memory) {
  const auto is_there = [&](const auto& item) { return item.segment < segments.segments.size(); };
  if (!std::all_of(detections.detections.begin(), detections.detections.end(), is_there) ||
      !std::all_of(detections.refused_segments.begin(), detections.refused_segments.end(), is_there)) {
    throw std::invalid_argument("detections are not of these segments");
  }
  thread_local std::vector<ExpectedOutline> known_level;  // kept for their memory
  thread_local std::vector<std::size_t> known_of;         // of each detection, index in known_level
  thread_local MappedAreas areas;
  known_level = outlines_at(segments.stamp_ns, segments.T_world_level, known, kMaxMapAge_s, std::move(known_level));
  known_of = known_of_each(detections, segments, known_level, std::move(known_of));

  std::vector<HitLabel> labels = std::move(memory);
  labels.assign(segments.points.size(), {HitFate::kNoSegment, hit_reason_index("other")});
  const auto label = [&](const auto& run, const HitLabel& of_all) {
    std::fill_n(labels.begin() + static_cast<std::ptrdiff_t>(run.first), run.count, of_all);
  };
  const auto label_segment = [&](std::size_t s, HitFate fate, const char* why, std::uint64_t id = 0) {
    label(segments.segments[s], {fate, hit_reason_index(why), id, s});
  };
  for (const RefusedRun& run : segments.refused_runs) {
    label(run, {HitFate::kNoSegment, hit_reason_index(text_of(run.why))});
  }
  for (std::size_t s = 0; s < segments.segments.size(); ++s) {
    const Segment& segment = segments.segments[s];
    if (segment.kind == SegmentKind::kStructure) {
      label_segment(s, HitFate::kStructure, text_of(segment.structure));
    } else {
      label_segment(s, HitFate::kRefused, "other");
    }
  }
  for (const RefusedSegment& refused : detections.refused_segments) {
    label_segment(refused.segment, HitFate::kRefused, refused.why);
  }
  areas.set(known);
  for (std::size_t i = 0; i < known_of.size(); ++i) {
    const Detection& detection = detections.detections[i];
    const std::size_t on = areas.object_at(segments.T_world_level * detection.middle_level_m);
    const std::uint64_t id = known_of[i] != kNotKnown   ? known_level[known_of[i]].id
                             : on != MappedAreas::kNone ? known.objects[on].id
                                                        : 0;
    label_segment(detection.segment, HitFate::kObject, "", id);
  }
  return labels;
}

const std::vector<const char*>& hit_reasons() {
  static const std::vector<const char*> reasons{
      "",
      text_of(StructureReason::kExtent),
      text_of(StructureReason::kInnerCorner),
      text_of(StructureReason::kStraightHidden),
      text_of(StructureReason::kFlat),
      text_of(StructureReason::kInLine),
      text_of(RunRefusal::kTooFewPoints),
      text_of(RunRefusal::kOutside),
      detection_refusal::kNotOneEllipse,
      detection_refusal::kBothEndsHidden,
      detection_refusal::kOffEllipse,
      detection_refusal::kTooLarge,
      detection_refusal::kAroundSensor,
      detection_refusal::kOutsideFieldOfView,
      detection_refusal::kNotFinite,
      detection_refusal::kBadRadii,
      detection_refusal::kBadProbability,
      detection_refusal::kBadCovariance,
      "other",
  };
  return reasons;
}

std::uint8_t hit_reason_index(const char* why) {
  const std::vector<const char*>& reasons = hit_reasons();
  const auto found = std::find_if(reasons.begin(), reasons.end() - 1,
                                  [why](const char* reason) { return std::string_view(reason) == why; });
  return static_cast<std::uint8_t>(found - reasons.begin());
}

}  // namespace situation_awareness
