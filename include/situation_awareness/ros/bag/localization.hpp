// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/pipeline/localization_pipeline.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/bag/odometry.hpp"
#include "situation_awareness/scan/range_limiter.hpp"
#include "situation_awareness/scan/scan.hpp"

namespace situation_awareness {

/// Where the reflectors are, from which the pose comes.
struct ReflectorOptions {
  std::string reflectors;    ///< file
  std::string initial_pose;  ///< of the base, as text; empty: none
  OdometryOptions odometry;
};

/// --reflectors, --initial-pose and those of the odometry.
void add_reflector_options(CommandLine& app, ReflectorOptions& options);

/// Throws CommandLineError if the initial pose is none, or if it is given without `by_reflectors`.
void check_reflector_options(const ReflectorOptions& options, bool by_reflectors);

/// A player of a bag whose scans wait for the odometry of their first and last beams.
BagPlayer player_by_odometry(const BagOptions& bag, const OdometryFrames& frames, double scan_offset_s);

/// Localisation by reflectors and odometry while a bag is played.
class BagLocalization {
 public:
  /// Handles a scan and the poses that it is placed by; returns whether the pose was known. To be done by place().
  using Use = std::function<bool(const Scan& scan, const OdometryScan& placed)>;

  /// Subscribes to odometry and scans of the player. `localization` outlives it. Throws as
  /// subscribe_odometry_scans.
  BagLocalization(BagPlayer& player, const ReflectorOptions& options, const OdometryFrames& frames,
                  const std::string& scan_topic, const RangeLimiterParams& scan_params,
                  LocalizationPipeline& localization, Use use);
  BagLocalization(const BagLocalization&) = delete;
  BagLocalization& operator=(const BagLocalization&) = delete;

  /// Prints at how many scans the pose was known, and what was refused.
  void print_summary();
  /// Why no scan could be mapped; empty if one could.
  std::string why_unknown() const { return known_ == 0 ? localization_.why_unknown() : ""; }

 private:
  LocalizationPipeline& localization_;
  bool needs_initial_;
  std::size_t known_ = 0, unknown_ = 0;
  Counters refused_;
};

}  // namespace situation_awareness
