// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/points/point_states.hpp"
#include "situation_awareness/points/points.hpp"
#include "situation_awareness/pose/reflectors.hpp"

namespace situation_awareness {

/// The intensities of beams, in classes of an eighth of an octave: scanners give them in units of their own, of 0 to 1,
/// 0 to 255 or 0 to 65,535, and linear in the light or not.
class IntensityHistogram {
 public:
  /// Not positive ones are in the lowest class.
  void add(float intensity) { ++counts_[class_of(intensity)]; }
  void clear() { counts_.fill(0); }

  /// Two groups of intensities with a gap in between, the upper one of few beams, as reflectors have.
  struct Groups {
    double lower_to = 0.0, upper_from = 0.0;  ///< the edges of the gap
    double between = 0.0;                     ///< in its middle, with two digits
  };
  /// Empty where they are not well apart, as of glossy things that are as bright as anything between dim and bright.
  std::optional<Groups> groups() const;

 private:
  /// Exponent and three bits of the mantissa of a positive float.
  static constexpr std::size_t kClasses = 2048;
  static std::size_t class_of(float intensity);

  std::array<std::uint32_t, kClasses> counts_{};
};

/// What scans show of reflectors, to tell why there is no pose or survey by them.
class ReflectorEvidence {
 public:
  explicit ReflectorEvidence(const ReflectorDetectionParams& params) : params_(params) { clear(); }

  /// The points of a scan and what was detected in them.
  void add(const Points& points, const ReflectorSightings& sightings);
  void clear();

  /// Why no scan so far shows a reflector, in one sentence: "the brightest beam is 240, below reflectors/min_intensity
  /// 430; the intensities are in two groups, up to 36 and from 190 on: set reflectors/min_intensity and
  /// min_peak_intensity to 83". Empty if one does, and without scans. The threshold is proposed and not used: what a
  /// robot localises by is not to change by itself, with the first glossy things that it sees.
  std::string why_none() const;

  /// The greatest number in one scan.
  std::size_t most_sightings() const { return most_sightings_; }

 private:
  std::string proposal() const;

  ReflectorDetectionParams params_;
  PointStates states_;
  std::uint64_t beams_ = 0;  ///< hits with an intensity
  float brightest_ = 0.0F, dimmest_ = 0.0F;
  IntensityHistogram intensities_;
  std::size_t most_sightings_ = 0;
  Counters refused_;
};

}  // namespace situation_awareness
