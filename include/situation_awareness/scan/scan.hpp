// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace situation_awareness {

/// State of one beam. REP-117 distinguishes three cases without a range: no return, an object too close to the sensor,
/// and an invalid measurement.
enum class BeamState : std::uint8_t {
  kHit,       ///< an object at `range_m`
  kOutside,   ///< an object at `range_m`, but outside the volume or range of interest
  kFree,      ///< no return within the sensor's range, `range_m` (REP-117: +inf)
  kTooClose,  ///< an object nearer than the sensor can measure (REP-117: -inf)
  kInvalid,   ///< no information (REP-117: NaN, or a range that the sensor's own limits exclude)
};

/// True for a return, inside or outside the volume of interest.
constexpr bool is_hit(BeamState state) { return state == BeamState::kHit || state == BeamState::kOutside; }

/// Intensity of a beam where the sensor does not measure it.
constexpr float kNoIntensity = std::numeric_limits<float>::quiet_NaN();

/// State, range and intensity of one beam.
struct Beam {
  float range_m = 0.0F;  ///< finite and > 0 where the state is kHit or kOutside; >= 0, maybe +inf, where kFree; else 0
  BeamState state = BeamState::kInvalid;
  float intensity = kNoIntensity;  ///< of the return, in the sensor's own units, unchecked; NaN where there is none
};

/// One revolution of a 2D LIDAR in the lidar frame: beam i points along
/// (cos a_i, sin a_i, 0) with a_i = angle_min_rad + i * angle_increment_rad.
/// Any number of beams, either sign of the increment, up to a full circle.
struct Scan {
  std::int64_t stamp_ns = 0;  ///< time of beam 0
  double angle_min_rad = 0.0;
  double angle_increment_rad = 0.0;  ///< not zero
  double time_increment_s = 0.0;     ///< from beam to beam, 0: all at the stamp
  std::vector<Beam> beams;
};

/// The state of a beam by REP-117 from its raw range. A finite range below `range_min_m` (drivers send 0 or negative
/// codes) is invalid; one of `range_max_m`, to rounding, or more is free, since simulators and drivers older than
/// REP-117 send it for no return. A free beam has the range `range_max_m`: the sensor has no information beyond it.
Beam beam_from_range(float range_m, float range_min_m, float range_max_m);

/// Reason why a scan cannot be used; empty if it can. Checked: at least two beams, finite angles, an increment
/// between a millionth of a radian and half a turn, and not more than one revolution.
const char* scan_defect(std::size_t beams, double angle_min_rad, double angle_increment_rad);
const char* scan_defect(const Scan& scan);

}  // namespace situation_awareness
