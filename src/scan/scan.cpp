// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/scan/scan.hpp"

#include <cmath>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

// Within these bounds, rounding keeps the azimuths of neighbouring beams distinct.
constexpr double kMaxFirstAngle_rad = 100.0;
constexpr double kMinIncrement_rad = 1e-6;

/// What is less below range_max says the same as range_max: more than the rounding of drivers, and than the 0.1 mm by
/// which costmap_2d keeps "nothing there" in range (obstacle_layer.cpp, laserScanValidInfCallback), and less than the
/// millimetre in which scanners count. A surface there is lost, but up to it all is free.
constexpr float kRangeMaxRounding_m = 5e-4F;

}  // namespace

Beam beam_from_range(float range_m, float range_min_m, float range_max_m) {
  if (std::isnan(range_m)) return {0.0F, BeamState::kInvalid};
  const bool infinite = std::isinf(range_m);
  if (infinite && range_m < 0.0F) return {0.0F, BeamState::kTooClose};
  const bool is_range_max = range_m > 0.0F && range_m > range_max_m - kRangeMaxRounding_m;
  if (infinite || is_range_max || range_m > range_max_m)
    return {range_max_m > 0.0F ? range_max_m : 0.0F, BeamState::kFree};
  if (range_m < range_min_m || range_m <= 0.0F) return {0.0F, BeamState::kInvalid};
  return {range_m, BeamState::kHit};
}

const char* scan_defect(std::size_t beams, double angle_min_rad, double angle_increment_rad) {
  if (beams == 0) return "empty scan";
  if (beams < 2) return "scan of a single beam";
  if (!std::isfinite(angle_min_rad) || !std::isfinite(angle_increment_rad)) return "scan angles not finite";
  if (angle_increment_rad == 0.0) return "angle increment of zero";
  if (std::abs(angle_min_rad) > kMaxFirstAngle_rad) return "first angle too large";
  if (std::abs(angle_increment_rad) < kMinIncrement_rad) return "angle increment too small";
  // Rounded increments of a full circle add up to a little more than one revolution.
  const double sweep_rad = std::abs(angle_increment_rad) * static_cast<double>(beams - 1);
  if (sweep_rad > 2.0 * kPi * (1.0 + 1e-4)) return "scan of more than one revolution";
  // The order of neighbouring beams would be ambiguous.
  if (std::abs(angle_increment_rad) > kPi) return "angle increment of more than half a turn";
  return "";
}

const char* scan_defect(const Scan& scan) {
  return scan_defect(scan.beams.size(), scan.angle_min_rad, scan.angle_increment_rad);
}

}  // namespace situation_awareness
