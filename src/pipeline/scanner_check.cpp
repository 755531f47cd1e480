// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/scanner_check.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "situation_awareness/common/format.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"

namespace situation_awareness {
namespace {

/// An offset is one of scan/stamp_at if it is so by this part of a sweep, or three standard deviations up to the second
/// part, and if the evidence against the stamp in use is strong: twice the logarithm of the likelihoods' ratio is this
/// (Kass and Raftery, Bayes factors, 1995: strong from 6 to 10). With the least standard deviation of an offset the
/// middle of a sweep is told from its first beam from 15 ms on; with 9, from 18 ms on, with 4, from 12 ms on.
constexpr double kStampTolerance = 0.2, kMostStampTolerance = 0.25;
constexpr double kStrongEvidence = 6.0;
/// A value for "nothing there" is proposed after so many scans, where it is this part of all beams.
constexpr std::uint64_t kMinScansOfValue = 50;
constexpr double kMinPartOfValue = 0.02;

/// The order of beams shows itself where the scanner turns by this from the first beam to the last, and in so many of
/// such scans or not at all.
constexpr double kLeastTurn_rad = 1e-3;
constexpr std::uint64_t kMostScansOfOrder = 3000;

/// Poses at the first and the last beam that differ by less, relative to the place, are of a scan without motion in it.
constexpr double kSamePose = 1e-9;

double part_of_sweep(const std::string& stamp_at) {
  if (stamp_at == "first") return 0.0;
  return stamp_at == "middle" ? 0.5 : 1.0;
}

double percent(std::uint64_t part, std::uint64_t all) {
  return all == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(all);
}

}  // namespace

ScannerCheck::ScannerCheck(const ScannerParams& scanner, double used_offset_s)
    : scanner_(scanner), as_said_(used_offset_s), reversed_(used_offset_s) {}

void ScannerCheck::add_ranges(const std::vector<float>& ranges, float range_max_m) {
  ++scans_;
  beams_ += ranges.size();
  for (const float range_m : ranges) {
    if (std::isnan(range_m)) {
      ++nan_;
    } else if (range_m == 0.0F) {
      ++zero_;
    } else if (beam_from_range(range_m, 0.0F, range_max_m).state == BeamState::kFree) {
      ++nothing_;
    }
  }
}

void ScannerCheck::add(const Scan& scan, const Points& points, const Eigen::Isometry3d& T_world_lidar,
                       const Eigen::Isometry3d& T_world_lidar_end) {
  using Order = ScanOrderEstimator::Order;
  const double steps = scan.beams.empty() ? 0.0 : static_cast<double>(scan.beams.size() - 1);
  sweep_s_ = steps * scan.time_increment_s;
  has_moved_in_scan_ = has_moved_in_scan_ || !T_world_lidar.isApprox(T_world_lidar_end, kSamePose);
  if (order_.order() != Order::kReversed) as_said_.add(points);
  if (!(sweep_s_ > 0.0) || order_.order() == Order::kAsSaid) return;
  if (order_.order() != Order::kReversed) {
    const Eigen::Matrix3d turn = T_world_lidar.linear().transpose() * T_world_lidar_end.linear();
    if (scans_of_order_ == kMostScansOfOrder || Eigen::AngleAxisd(turn).angle() < kLeastTurn_rad) return;
    ++scans_of_order_;
  }
  // Measured the other way round the first beam is the last: its pose is that of the level frame, at its time.
  reversed_points_ = project_horizontally(scan, T_world_lidar_end, T_world_lidar, std::move(reversed_points_));
  reversed_points_.stamp_ns += nanoseconds(sweep_s_);
  reversed_.add(reversed_points_);
  order_.add(points, reversed_points_);
}

const PoseOffsetEstimator& ScannerCheck::pose_offset() const {
  return order_.order() == ScanOrderEstimator::Order::kReversed ? reversed_ : as_said_;
}

/// Empty where the offset is none of a stamp at another beam, and for scans of clouds.
std::string ScannerCheck::stamp_at_that_fits() const {
  if (!has_moved_in_scan_) return "";
  const PoseOffset& estimate = pose_offset().estimate();
  if (!estimate.is_known) return "";
  const double late_s = pose_offset().used_offset_s() - estimate.offset_s;
  const double tolerance_s =
      std::max(kStampTolerance * sweep_s_, std::min(3.0 * estimate.sigma_s, kMostStampTolerance * sweep_s_));
  for (const char* stamp_at : {"first", "middle", "last"}) {
    const double expected_s = (part_of_sweep(stamp_at) - part_of_sweep(scanner_.stamp_at)) * sweep_s_;
    const double off_s = late_s - expected_s;
    const double evidence = (late_s * late_s - off_s * off_s) / (estimate.sigma_s * estimate.sigma_s);
    if (std::abs(off_s) <= tolerance_s && evidence >= kStrongEvidence) return stamp_at;
  }
  return "";
}

bool ScannerCheck::is_out_of_step() const {
  return situation_awareness::is_out_of_step(pose_offset().estimate(), pose_offset().used_offset_s()) &&
         stamp_at_that_fits().empty();
}

std::vector<std::string> ScannerCheck::advice() const {
  std::vector<std::string> sentences;
  if (order_.order() == ScanOrderEstimator::Order::kReversed) {
    const bool is_forward = scanner_.beam_order == "forward";
    sentences.push_back(
        std::string("the beams of a scan are measured in the other order than its time_increment has it:"
                    " set scan/beam_order to ") +
        (is_forward ? "backward, not forward" : "forward, not backward"));
  }
  const std::string stamp_at = stamp_at_that_fits();
  if (!stamp_at.empty()) {
    const double offset_s = pose_offset().estimate().offset_s;
    const double late_s = part_of_sweep(scanner_.stamp_at) * sweep_s_ + pose_offset().used_offset_s() - offset_s;
    sentences.push_back(
        formatted("the stamp of a scan of %.3f s is %.3f s after its first beam: set scan/stamp_at to %s, not %s, "
                  "and leave scan_pose_offset_s",
                  sweep_s_, late_s, stamp_at.c_str(), scanner_.stamp_at.c_str()));
  }
  return sentences;
}

std::string ScannerCheck::no_return_advice() const {
  if (scans_ < kMinScansOfValue || nothing_ > 0) return "";
  const bool is_zero = zero_ >= nan_;
  const double part = percent(is_zero ? zero_ : nan_, beams_);
  if (part < 100.0 * kMinPartOfValue) return "";
  return formatted(
      "no beam of %llu scans says that nothing is there (+inf, or range_max), and %.0f %% are %s, which is no "
      "information: where the driver sends that for nothing there, set scan/no_return to %s",
      static_cast<unsigned long long>(scans_), part, is_zero ? "0" : "NaN", is_zero ? "zero" : "nan");
}

std::string ScannerCheck::no_return_text() const {
  const std::string advice = no_return_advice();
  if (!advice.empty()) return advice;
  return formatted("%.1f %% of the beams, and %.1f %% are 0, %.1f %% NaN", percent(nothing_, beams_),
                   percent(zero_, beams_), percent(nan_, beams_));
}

}  // namespace situation_awareness
