// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/localization.hpp"

#include <cstdint>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <utility>

#include "command_line.hpp"
#include "situation_awareness/geometry/parse_pose2.hpp"

namespace situation_awareness {
namespace {

/// Of an initial pose.
constexpr double kInitialSigma_m = 0.12;
constexpr double kInitialSigma_rad = 0.07;

/// Where reflectors did not suffice the pose is that of odometry.
void print_coverage(const ReflectorCoverage& coverage) {
  std::printf(
      "reflectors: fewer than %zu matched for %.1f s of %.1f s, %.1f s at a stretch; standard deviation of the pose up "
      "to %.3f m, %.4f rad\n",
      ReflectorCoverage::kNeeded, coverage.too_few_s, coverage.all_s, coverage.longest_s, coverage.largest_sigma_m,
      coverage.largest_sigma_rad);
}

}  // namespace

void add_reflector_options(CommandLine& app, ReflectorOptions& options) {
  add_odometry_options(app, options.odometry);
  app.add_option("--reflectors", options.reflectors, "the reflectors, from which the pose comes").type_name("FILE");
  app.add_option("--initial-pose", options.initial_pose, "of the base at the start, good to 12 cm and 4 degrees")
      .type_name("X,Y,YAW");
}

void check_reflector_options(const ReflectorOptions& options, bool by_reflectors) {
  if (by_reflectors && options.reflectors.empty()) throw option_required("--reflectors");
  if (!by_reflectors && !options.initial_pose.empty()) throw CommandLineError("--initial-pose is for --reflectors");
  if (options.initial_pose.empty()) return;
  check_option([&options] { parse_pose2(options.initial_pose, "--initial-pose"); });
}

BagPlayer player_by_odometry(const BagOptions& bag, const OdometryFrames& frames, double scan_offset_s) {
  return {bag, {frames.base, true, scan_offset_s}};
}

BagLocalization::BagLocalization(BagPlayer& player, const ReflectorOptions& options, const OdometryFrames& frames,
                                 const std::string& scan_topic, const RangeLimiterParams& scan_params,
                                 LocalizationPipeline& localization, Use use)
    : localization_(localization), needs_initial_(!options.initial_pose.empty()) {
  const Pose2 initial = needs_initial_ ? parse_pose2(options.initial_pose, "--initial-pose") : Pose2{};
  UseOdometry use_odometry;
  use_odometry.add = [this, initial](std::int64_t stamp_ns, const Pose2& T_odom_base, std::int64_t received_ns) {
    const auto verdict = localization_.add_odometry(stamp_ns, T_odom_base, received_ns);
    if (needs_initial_ && verdict != OdometryTrack::Verdict::kRefused) {
      localization_.localization().initial_pose(stamp_ns, initial, kInitialSigma_m, kInitialSigma_rad);
      needs_initial_ = false;
    }
    return verdict;
  };
  localization_.localization().trust_scan_stamps();
  use_odometry.use = [this, use_scan = std::move(use)](const Scan& scan, const OdometryScan& placed) {
    ++(use_scan(scan, placed) ? known_ : unknown_);
  };
  subscribe_odometry_scans(player, options.odometry.topic, scan_topic, scan_params, frames, refused_,
                           std::move(use_odometry));
}

void BagLocalization::print_summary() {
  std::printf("pose known at %zu scans, unknown at %zu\n", known_, unknown_);
  print_coverage(localization_.localization().coverage());
  for (const auto& [reason, count] : localization_.localization().counters()) refused_[reason] += count;
  for (const auto& [reason, count] : refused_) {
    std::printf("localization: %llu %s\n", static_cast<unsigned long long>(count), reason.c_str());
  }
}

}  // namespace situation_awareness
