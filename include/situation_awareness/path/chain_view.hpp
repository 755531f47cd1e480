// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/geometry/pose2.hpp"
#include "situation_awareness/points/points.hpp"

namespace situation_awareness {

/// What a scan should see of the chains of a map, and whether its beams pass through them (docs/math/path.md). A beam
/// is judged where chains fill the whole width of their uncertainty about it, and are not seen at a grazing angle. It
/// passes through them if its range is beyond all of that. Of chains that the map saw of late and others, as of a file,
/// those count alone where both are in the way. No allocation after warm-up; in time linear in the beams that chains
/// are in the way of.
class ChainView {
 public:
  static constexpr double kFixed_m = 3.0;  ///< as large as this is no thing that is taken away at once

  enum class Look : std::uint8_t {
    kNotJudged,
    kAgrees,         ///< with the map, or something is in between
    kPasses,         ///< to a hit beyond
    kWithoutReturn,  ///< passes, and nothing is there up to the greatest range
  };

  struct Beam {
    Look look = Look::kNotJudged;
    std::uint64_t id = 0;                                     ///< of the nearest chain in the way, and
    double near_m = std::numeric_limits<double>::infinity();  ///< its range, and
    double far_m = std::numeric_limits<double>::infinity();   ///< that up to which a hit would be on it
    double wide_m = 0.0;                                      ///< half the width of its uncertainty there
    bool is_known = false;                                    ///< the chain has been there for long, and
    bool is_fixed = false;                                    ///< is larger than what can be taken away
    bool was_seen = false;                                    ///< the map saw it of late
  };

  /// A new scan, of which chains up to `range_m` are looked for. `points` are kept until judge().
  void begin(const Points& points, double range_m, double pose_sigma_m, double pose_sigma_rad);

  /// An edge of a chain; a hit on it is nearer than `reach_m` to it.
  void add(const Eigen::Vector2d& from_world_m, const Eigen::Vector2d& to_world_m, double reach_m, std::uint64_t id,
           bool is_known, bool is_fixed, bool was_seen);

  /// After the last edge.
  void judge();

  double range_m() const { return range_m_; }

  /// One for each point of the scan.
  const std::vector<Beam>& beams() const { return beams_; }

 private:
  void take(std::size_t i, const Eigen::Vector2d& from_m, const Eigen::Vector2d& n, const Beam& edge, double reach_m);

  const Points* points_ = nullptr;
  Pose2 T_level_world_;
  double range_m_ = 0.0, sigma_m_ = 0.0, sigma_rad_ = 0.0;
  std::vector<Beam> beams_;
};

}  // namespace situation_awareness
