// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/scan/scan.hpp"

#include <cmath>

#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {

Beam beam_from_range(float range_m, float range_min_m, float range_max_m) {
  if (std::isnan(range_m)) return {0.0F, BeamState::kInvalid};
  if (std::isinf(range_m)) return {0.0F, range_m > 0.0F ? BeamState::kFree : BeamState::kTooClose};
  if (range_m > range_max_m) return {0.0F, BeamState::kFree};
  if (range_m < range_min_m || range_m <= 0.0F) return {0.0F, BeamState::kInvalid};
  return {range_m, BeamState::kHit};
}

const char* scan_defect(const Scan& scan) {
  if (scan.beams.empty()) return "empty scan";
  if (scan.beams.size() < 2) return "scan of a single beam";
  if (!std::isfinite(scan.angle_min_rad) || !std::isfinite(scan.angle_increment_rad)) return "scan angles not finite";
  if (scan.angle_increment_rad == 0.0) return "angle increment of zero";
  // Rounded increments of a full circle add up to a little more than one revolution.
  const double sweep_rad = std::abs(scan.angle_increment_rad) * static_cast<double>(scan.beams.size() - 1);
  if (sweep_rad > 2.0 * kPi * (1.0 + 1e-4)) return "scan of more than one revolution";
  return "";
}

}  // namespace situation_awareness
